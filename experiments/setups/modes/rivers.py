"""Crossing rivers as a run: the default three about a circle, or those of a lifted map."""

from dataclasses import replace

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from controllers.safety.energy_tank import river_power
from experiments.config.modes import Rivers, gates_rivers
from experiments.config.run_config import RunConfig
from experiments.setups.modes.fixed_curve import FixedField, fixed_curve_parts
from experiments.setups.parts.budget import fastest
from experiments.setups.parts.defaults import river_gains
from experiments.setups.parts.governor import governed, speeds_along
from experiments.setups.parts.hands import MIN_PUSHED_RIVER_SPEED
from experiments.setups.parts.pace import course_of, paced
from experiments.setups.parts.part_types import ClipMapParts, Notes, Parts, RiverChoice, Static
from sim.viewer.shown import COURSE_POINTS

# In units of the default curve's speed. A hand at rest is admitted, since its velocity differs by 1 from the current's;
# a hand that crosses at a right angle is not: the difference is √2. Without hysteresis rivers chatter after 4 ms.
ADMISSION, HYSTERESIS = 1.2, 0.15
# [m/s] least hysteresis of rivers that cross, that of the encoders' noise: with less of it a push out of a river at
# 32 mm/s changes over 20 times in 0.3 s instead of once (docs/validation/crossing-rivers.md).
LEAST_HYSTERESIS = 0.01
# hysteresis over speed of rivers side by side, as on a lifted map: position tells them apart
SIDE_BY_SIDE_HYSTERESIS = 0.05
# σ over speed of the same: position counts more than the hand's velocity across. With that of rivers that cross a hand
# that was pushed at 0.1 m/s from one curve to another, 11 mm away, passed it by and left both tubes.
SIDE_BY_SIDE_SIGMA = 0.5
# In the smooth form σ sets the angle up to which rivers are blended. A blend of diverging tubes throws the hand out of
# both: with 0.05 blending ends at 20°, before the middle between the tubes lies outside them.
SIGMA = {"discrete": 0.15, "smooth": 0.05}
# [s] time constant of the low-pass of the velocity that selects a river. Encoders make 10 mm/s of noise, more than the
# smooth form's σ; without it a push changes river up to eight times instead of twice, laps of 8 s chatter without a
# push, and laps of 14 s throw a relaxed hand out (docs/validation/crossing-rivers.md).
SELECTION_TIME_CONSTANT = 8e-3
GATE_ADMISSION = 0.4  # admission of rivers with intervals of admissible speed: a hand further outside them is not taken
WAVE_FRACTION = 0.6  # height of the wave as a share of the map's half width


def rivers_parts(config: RunConfig, mode: Rivers, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "rivers"."""
    stiffness, damping = river_gains(mode)
    course, choice, urged = course_of(maps.curve, damping, stiffness), maps.rivers(mode), 0.0
    if mode.governor is not None and gates_rivers(mode.crossing):
        law = law_of(mode, gated(choice, maps), GATE_ADMISSION)
    else:
        law, urged = governed(mode.governor, law_of(mode, choice), course, maps)
    bundle = river_bundle(course, maps.reach, river_time(mode), damping, mode.river_tube)
    power = sum(river_power(damping, fastest(river.curve)) for river in bundle.rivers)
    springs = ((stiffness, mode.river_tube),) * len(bundle.rivers)
    static = {**drawn(choice.bundle, maps), **own_clips(choice, maps)}
    notes = Notes("RIVERS", mode.river_tube, "tube", "its river", static=static)
    pushes = maps.river_pushes(mode, config.seconds) if config.user.does == "push" and not config.user.pushes else None
    field = FixedField(law, course, power, springs, notes, urged, pushes=pushes, other=beside(choice.given, maps.curve))
    parts = fixed_curve_parts(config, mode, maps, field)
    return replace(parts, remarks=parts.remarks + slow_remark(choice.pace), cross_track=choice.cross_track)


def slow_remark(pace: float) -> tuple[str, ...]:
    """Remark, if rivers of this speed [m/s] are too slow for a push from one into another."""
    if pace >= MIN_PUSHED_RIVER_SPEED:
        return ()
    return (
        f"the rivers lead the hand at {1e3 * pace:.1f} mm/s: so slowly that a push out of one is a push out of all, "
        f"so --user push does not push; above {1e3 * MIN_PUSHED_RIVER_SPEED:.0f} mm/s it does (a shorter --lap, a "
        "larger --radius)",
    )


def beside(curves: tuple[Trajectory, ...], own: Trajectory) -> Trajectory | None:
    """The curve nearest to `own`, by the mean distance at equal shares of the lap; None if there is no other."""
    share = np.linspace(0.0, 1.0, 33)
    here = own.point(own.start + share * own.duration)
    away = [np.linalg.norm(c.point(c.start + share * c.duration) - here, axis=1).mean() for c in curves]
    return curves[np.argsort(away)[1]] if len(curves) > 1 else None


def river_time(mode: Rivers) -> float:
    """τ = b_d / k_r of a river [s]."""
    stiffness, damping = river_gains(mode)
    return damping / stiffness


def law_of(mode: Rivers, choice: RiverChoice, admission: float = ADMISSION) -> Law:
    """Law of force of several rivers: their sum, or a higher-order law that gives the hand to one river."""
    if mode.crossing == "sum":
        return choice.bundle
    discrete = mode.crossing == "discrete"
    return HigherOrder(
        choice.bundle,
        admission * choice.pace,
        choice.sigma if discrete and choice.sigma > 0.0 else SIGMA[mode.crossing] * choice.pace,
        choice.hysteresis,
        mode.crossing,
        SELECTION_TIME_CONSTANT,
        choice.ease if discrete else 0.0,
    )


def gated(choice: RiverChoice, maps: ClipMapParts) -> RiverChoice:
    """The same rivers, each restricted to the speeds at which the flights of its animation are ballistic enough."""
    rivers = tuple(
        replace(river, speeds=speeds_along(maps, curve, i, river.curve))
        for i, (river, curve) in enumerate(zip(choice.bundle.rivers, choice.given, strict=True))
    )
    return choice._replace(bundle=replace(choice.bundle, rivers=rivers))


def default_choice(mode: Rivers, curve: Trajectory, reach: float) -> RiverChoice:
    """The default rivers about a curve (`river_bundle`), timed to lead the Phantom at their own pace (`paced`).

    Their reference speed is the curve's mean speed.

    Raises
    ------
    SimError
        If the Phantom does not reach one of them.
    """
    bundle = river_bundle(curve, reach, river_time(mode), river_gains(mode)[1], mode.river_tube)
    led = tuple(replace(river, curve=paced(river.curve, river.drag, river.drag / river.tau)) for river in bundle.rivers)
    given = tuple(river.curve for river in bundle.rivers)
    pace = curve.length / curve.duration
    return RiverChoice(replace(bundle, rivers=led), given, pace, max(HYSTERESIS * pace, LEAST_HYSTERESIS))


def drawn(bundle: RiverBundle, maps: ClipMapParts) -> Static:
    """Names of rivers, with that of the clip that each plays, and their curves, for summary, figures and replays."""
    names, clips = bundle.names, maps.clips
    if maps.plays_rivers:
        names = tuple(f"{name} ({' '.join(clips[k % len(clips)].name.split())})" for k, name in enumerate(names))
    share = np.linspace(0.0, 1.0, COURSE_POINTS)
    curves = [r.curve.point(r.curve.start + share * r.curve.duration) for r in bundle.rivers]
    return {"river_names": "\n".join(names), "river_curves": np.array(curves)}


def own_clips(choice: RiverChoice, maps: ClipMapParts) -> Static:
    """For the summary, the duration [s] of a lap of each river at the own pace of its clip, where each has its own."""
    if maps.curve_clip_seconds is not None:
        return {"river_clip_laps": np.array([curve.duration for curve in choice.given])}
    return {"river_clip_laps": np.resize(maps.lap_durations, len(choice.given))} if maps.plays_rivers else {}


def river_bundle(curve: Trajectory, reach: float, tau: float, drag: float, epsilon: float) -> RiverBundle:
    """The default curve; a wave about it, up and down twice a lap; and the curve lifted to the wave's crests.

    The wave crosses the default curve and touches the lifted one; at these places a hand can change over.

    Parameters
    ----------
    curve : Trajectory
        A lap about the z axis.
    reach : float
        Half width of the map's domain [m]; the crests are at `WAVE_FRACTION` times it.
    tau, drag, epsilon : float
        τ [s], b [N s/m] and ε [m] of the rivers.
    """
    times = np.linspace(curve.start, curve.end, 129)
    level = curve.point(times)
    level[-1] = level[0]
    wave = np.sin(4.0 * np.pi * np.linspace(0.0, 1.0, 129))
    height = WAVE_FRACTION * reach * np.stack((np.zeros(129), wave, np.ones(129)))
    height[1, -1] = 0.0
    curves = [Trajectory(times, level + np.outer(z, [0.0, 0.0, 1.0]), periodic=True) for z in height]
    return RiverBundle(tuple(River(c, epsilon, tau, drag) for c in curves), ("level", "wave", "high"))
