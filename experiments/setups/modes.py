"""The modes of a run that are fields over a fixed curve: follow, bunny, rivers; and how fast the heaviest one is."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bundle import RiverBundle
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.fields.law import Law, Program
from controllers.fields.program import Compiled, evaluate
from controllers.fields.river import River
from controllers.safety.limiter import ForceLimiter, limit_force
from controllers.state import HandState
from experiments.config.run_config import RunConfig

Array = npt.NDArray[np.float64]

# Of the speed of the default curve. A hand at rest is taken: its velocity is 1 from the current's; one that crosses
# at a right angle is not: it is √2 from it.
ADMISSION, HYSTERESIS = 1.2, 0.15
BESIDE = 0.05  # the hysteresis of rivers side by side, as a map's own are: places tell them apart, not directions
# Smooth, σ says up to which angle rivers are blended, and a blend of tubes that part throws the hand out of both: with
# 0.05 it ends at 20°, before the middle leaves the tubes.
SIGMA = {"discrete": 0.15, "smooth": 0.05}
# Encoders make 10 mm/s of noise, which is more than the smooth form's σ; the discrete one has its hysteresis.
LOOK = {"discrete": 0.0, "smooth": 8e-3}
GATE = 0.4  # the admission of rivers that say what speeds they take: a hand that misses them by more stays out
WAVE = 0.6  # height of the wave, of the map's half width


Field = Law


def law(
    config: RunConfig,
    curve: Trajectory,
    speeds_of: Callable[[int, Trajectory], Array] | None = None,
    rivers: RiverBundle | None = None,
) -> Field:
    """Field of a mode over a curve, or over rivers of a map's own.

    `speeds_of` gives the admissible speeds of rivers, see `River.speeds`.

    Raises
    ------
    ParameterError
        If the mode is none of follow, bunny, rivers, or a number is out of its interval.
    """
    if config.mode == "follow":
        return Follow(curve, config.stiffness, config.damping, config.tube)
    if config.mode == "bunny":
        return Bunny(
            curve, config.stiffness, config.damping, config.bunny_width, config.bunny_attraction, config.bunny_pace
        )
    if config.mode == "rivers":
        bundle, hysteresis = (default_rivers(config, curve), HYSTERESIS) if rivers is None else (rivers, BESIDE)
        return _rivers(config, bundle, _pace(curve, rivers), hysteresis, speeds_of)
    raise ParameterError(f"no field for the mode {config.mode!r}; there are follow, bunny, rivers")


def default_rivers(config: RunConfig, curve: Trajectory) -> RiverBundle:
    """The rivers of the mode of that name (`river_bundle`) with a configuration's gains.

    Raises
    ------
    ParameterError
        If a gain is out of its interval.
    """
    return river_bundle(curve, config.reach, river_time(config), config.gains[1], config.river_tube)


def river_time(config: RunConfig) -> float:
    """τ = b_d / k_r of a river with a configuration's gains [s].

    Raises
    ------
    ParameterError
        If a gain is not positive.
    """
    stiffness, damping = config.gains
    if damping <= 0.0 or stiffness <= 0.0:
        raise ParameterError(f"a river's time is damping/stiffness: both must be positive, got {damping}, {stiffness}")
    return damping / stiffness


def _pace(curve: Trajectory, rivers: RiverBundle | None) -> float:
    """Speed that rivers are told apart by [m/s]: the default curve's, or the greatest, at which a hand is taken too."""
    if rivers is None:
        return curve.length / curve.duration
    curves = [river.curve for river in rivers.rivers]
    speeds = [np.linalg.norm(c.velocity(np.linspace(c.start, c.end, 512)), axis=1).max() for c in curves]
    return float(max(speeds))


def _rivers(
    config: RunConfig,
    bundle: RiverBundle,
    pace: float,
    hysteresis: float,
    speeds_of: Callable[[int, Trajectory], Array] | None,
) -> Field:
    if config.crossing == "sum":
        return bundle
    admission = ADMISSION
    if speeds_of is not None:
        gated = tuple(replace(river, speeds=speeds_of(i, river.curve)) for i, river in enumerate(bundle.rivers))
        bundle, admission = replace(bundle, rivers=gated), GATE
    return HigherOrder(
        bundle, admission * pace, SIGMA[config.crossing] * pace, hysteresis * pace, config.crossing,
        LOOK[config.crossing],
    )  # fmt: skip


def river_bundle(curve: Trajectory, reach: float, tau: float, drag: float, epsilon: float) -> RiverBundle:
    """The default curve; a wave about it, up and down twice a lap; and the curve lifted to the wave's crests.

    The wave crosses the first, and touches the last: there a hand can change over.

    Parameters
    ----------
    curve : Trajectory
        A lap about the z axis.
    reach : float
        Half width of the map's domain [m]; the crests are at `WAVE` times it.
    tau, drag, epsilon : float
        Of the rivers: τ [s], b [N s/m], ε [m].
    """
    times = np.linspace(curve.start, curve.end, 129)
    level = curve.point(times)
    level[-1] = level[0]
    height = WAVE * reach * np.stack((np.zeros(129), np.sin(4.0 * np.pi * np.linspace(0.0, 1.0, 129)), np.ones(129)))
    height[1, -1] = 0.0
    curves = [Trajectory(times, level + np.outer(z, [0.0, 0.0, 1.0]), periodic=True) for z in height]
    return RiverBundle(tuple(River(c, epsilon, tau, drag) for c in curves), ("level", "wave", "high"))


@njit
def _ticks(field: Compiled, memory: Array, limits: Array, limiter: Array, hands: Array, force: Array) -> float:
    wrench, total = np.zeros(6), 0.0
    for i in range(hands.shape[0]):
        evaluate(field.units, field.ops, field.params, memory, hands[i], wrench)
        limit_force(limits, limiter, wrench, force)
        total += force[0]
    return total


def heaviest_field() -> tuple[Program, Array]:
    """Ten rivers that all come near, smooth, of higher order, limited; and a lap of hands that feel them."""
    lap = Trajectory.circle(0.05, 4.0)
    times = np.linspace(0.0, 4.0, 129)
    angle = 0.5 * np.pi * times
    rivers: list[River] = []
    for k in range(10):
        points = lap.point(times)
        points[:, 2] = 0.015 * np.sin((k % 3 + 1) * angle + k)
        points[-1] = points[0]
        rivers.append(River(Trajectory(times, points, periodic=True)))
    bundle = RiverBundle(tuple(rivers), tuple(f"river {k}" for k in range(10)))
    hands = np.array([HandState.at(lap.point(t), lap.velocity(t), t).vector() for t in np.arange(4000) * 1e-3])
    return HigherOrder(bundle, 0.09, 0.025).program().limited(8.0), hands


def tick_microseconds(program: Program, hands: Array) -> float:
    """Mean processor time of a tick of a field with the safety limiter [µs], the best of five laps of hands."""
    limiter, memory, best = ForceLimiter(1e-3), program.fresh_memory(), np.inf
    heat = limiter.fresh_memory()
    for lap in range(6):
        rows = hands[:2] if lap == 0 else hands
        begin = time.thread_time()
        _ticks(program.compiled(), memory, limiter.limits(), heat, rows, np.zeros(3))
        best = best if lap == 0 else min(best, time.thread_time() - begin)
    return 1e6 * best / len(hands)
