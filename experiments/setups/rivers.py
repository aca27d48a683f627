"""Crossing rivers as a run: the default three about a circle, or those of a lifted map."""

from dataclasses import replace

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.law import Law
from controllers.fields.river import River
from controllers.safety.energy_tank import river_power
from experiments.config.modes import Rivers
from experiments.config.run_config import RunConfig
from experiments.setups.budget import fastest
from experiments.setups.defaults import river_gains
from experiments.setups.fixed_curve import FixedField, fixed_curve_parts
from experiments.setups.governor import governed, speeds_along
from experiments.setups.pace import paced
from experiments.setups.parts import ClipMapParts, Notes, Parts, RiverChoice, Static

# Of the speed of the default curve. A hand at rest is taken: its velocity is 1 from the current's; one that crosses
# at a right angle is not: it is √2 from it.
ADMISSION, HYSTERESIS = 1.2, 0.15
BESIDE = 0.05  # the hysteresis of rivers side by side, as a map's own are: places tell them apart, not directions
# Smooth, σ says up to which angle rivers are blended, and a blend of tubes that part throws the hand out of both: with
# 0.05 it ends at 20°, before the middle leaves the tubes.
SIGMA = {"discrete": 0.15, "smooth": 0.05}
# Encoders make 10 mm/s of noise, which is more than the smooth form's σ; the discrete one has its hysteresis.
LOOK = {"discrete": 0.0, "smooth": 8e-3}
SLOWEST = 0.03  # [m/s], three times that noise: rivers along which the hand goes more slowly are told apart by chance
GATE = 0.4  # the admission of rivers that say what speeds they take: a hand that misses them by more stays out
WAVE = 0.6  # height of the wave, of the map's half width


def rivers_parts(config: RunConfig, mode: Rivers, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "rivers"."""
    stiffness, damping = river_gains(mode)
    course, choice, urged = maps.course(damping, stiffness), maps.rivers(mode), 0.0
    if mode.governor is not None and mode.crossing != "sum":
        law = law_of(mode, gated(choice, maps), GATE)
    else:
        law, urged = governed(mode.governor, law_of(mode, choice), course, maps)
    bundle = river_bundle(course, maps.reach, river_time(mode), damping, mode.river_tube)
    power = sum(river_power(damping, fastest(river.curve)) for river in bundle.rivers)
    springs = ((stiffness, mode.river_tube),) * len(bundle.rivers)
    notes = Notes("RIVERS", mode.river_tube, "tube", "its river", static=drawn(choice.bundle))
    pushes = maps.river_pushes(mode, config.seconds) if config.user.does == "push" and not config.user.pushes else None
    field = FixedField(law, course, power, springs, notes, urged, pushes=pushes)
    return fixed_curve_parts(config, mode, maps, field)


def river_time(mode: Rivers) -> float:
    """τ = b_d / k_r of a river [s]."""
    stiffness, damping = river_gains(mode)
    return damping / stiffness


def law_of(mode: Rivers, choice: RiverChoice, admission: float = ADMISSION) -> Law:
    """Law of rivers: their sum, or of higher order."""
    bundle, _, pace, hysteresis = choice
    if mode.crossing == "sum":
        return bundle
    return HigherOrder(
        bundle, admission * pace, SIGMA[mode.crossing] * pace, hysteresis * pace, mode.crossing, LOOK[mode.crossing]
    )


def gated(choice: RiverChoice, maps: ClipMapParts) -> RiverChoice:
    """The same rivers, each with the speeds that the flights of its animation admit."""
    rivers = tuple(
        replace(river, speeds=speeds_along(maps.haptic_map, curve, i, river.curve))
        for i, (river, curve) in enumerate(zip(choice.bundle.rivers, choice.given, strict=True))
    )
    return choice._replace(bundle=replace(choice.bundle, rivers=rivers))


def default_choice(mode: Rivers, curve: Trajectory, reach: float) -> RiverChoice:
    """The default rivers about a curve (`river_bundle`), which lead the Phantom at their own pace (`paced`).

    They are told apart by the curve's mean speed.

    Raises
    ------
    SimError
        If the Phantom does not reach one of them.
    """
    bundle = river_bundle(curve, reach, river_time(mode), river_gains(mode)[1], mode.river_tube)
    led = tuple(replace(river, curve=paced(river.curve, river.drag, river.drag / river.tau)) for river in bundle.rivers)
    given = tuple(river.curve for river in bundle.rivers)
    return RiverChoice(replace(bundle, rivers=led), given, curve.length / curve.duration, HYSTERESIS)


def drawn(bundle: RiverBundle) -> Static:
    """Names and curves of rivers, for figures and replays."""
    share = np.linspace(0.0, 1.0, 241)
    curves = [r.curve.point(r.curve.start + share * r.curve.duration) for r in bundle.rivers]
    return {"river_names": "\n".join(bundle.names), "river_curves": np.array(curves)}


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
