"""Which clips cannot be blended with others, because of long flights or somersaults, and which laps suit clips."""

from collections.abc import Sequence

import numpy as np

from controllers.legs.limbs import Limb
from controllers.motion.loops import Loop, checked_clip, closed_loop
from controllers.motion.strides import fit_to_lap, natural_lap
from geometry import quaternions
from geometry.spans import spans
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, JOINTS
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from sim.body.figure_state import FigureGains

MAX_FLIGHT_TIME = 0.3  # [s], 11 cm high: the mean of a longer flight and a motion on the floor is neither
MIN_FLYING_PACE, MAX_FLYING_PACE = 0.9, 1.1  # the same for clips with flights, which then need 0.8 to 1.2 of gravity
MIN_PACE, MAX_PACE = 0.75, 1.33  # played pace over the clip's own: inertial forces scale with its square, 0.56 to 1.8
# [rad] a joint that turns farther from its zero goes round, as in 7 of 143 prepared captures: a fault of the capture
_MAX_JOINT_TURN = np.deg2rad(240.0)
_MAX_ROUND_LAP = 6.0  # [s] of a lap in a round: in slower rivers a push hardly moves a hand to another one
_LAP_TOLERANCE = 0.02  # laps of less relative difference count as equal: `natural_lap` takes the shortest of them


def longest_flight(clip: Clip) -> float:
    """Longest time that the figure would be in flight [s]: no point of a sole is below `FigureGains.flight_height`."""
    flying = (sole_points(clip.poses)[:, :, 2] - CONTACT_RADIUS).min(axis=1) > FigureGains().flight_height
    return max((end - start for start, end in spans(flying)), default=0) / clip.fps


def all_same(clips: Sequence[Clip]) -> bool:
    """Whether all clips have the same poses."""
    return all(np.array_equal(clip.poses, clips[0].poses) for clip in clips)


def not_blendable(clips: Sequence[Clip]) -> tuple[str, ...]:
    """Remarks on clips that cannot be blended with the others, a line each; none if all clips are the same."""
    if all_same(clips):
        return ()
    lines: list[str] = []
    for clip in {clip.name: clip for clip in clips}.values():
        flight = longest_flight(clip)
        if clip.turns_over:
            fault = f"turns over (pelvis {np.rad2deg(np.arccos(clip.min_pelvis_cosine)):.0f}° from upright)"
            lines.append(f"{clip.name} {fault}: it cannot be blended with others")
        elif flight > MAX_FLIGHT_TIME:
            lines.append(
                f"{clip.name} is off the floor for {flight:.2f} s: it cannot be blended with what stays on the floor"
            )
    return tuple(lines)


def going_round(clips: Sequence[Clip], legs: Sequence[Limb]) -> tuple[str, ...]:
    """Remarks on clips in which a joint that is no limb's goes round; none if all clips are the same."""
    if all_same(clips):
        return ()
    free = [joint - 1 for joint in range(1, len(BODIES)) if all(joint not in leg.joints for leg in legs)]
    lines: list[str] = []
    for clip in {clip.name: clip for clip in clips}.values():
        cosines = quaternions.sign_continuous(clip.poses[:, 7:].reshape(clip.n_frames, -1, 4))[:, free, 0]
        turns = 2.0 * np.arccos(np.clip((cosines * np.where(cosines.sum(axis=0) < 0.0, -1.0, 1.0)).min(axis=0), -1, 1))
        if round_ := [JOINTS[free[k]] for k in np.flatnonzero(turns > _MAX_JOINT_TURN)]:
            lines.append(f"{clip.name} turns {', '.join(round_)} round: blended with others, such a joint may jump")
    return tuple(lines)


def timing_clip(clips: Sequence[Clip]) -> int:
    """Index of the clip that times the lap: the first without a flight, or else the first.

    Which clip's legs are combined with the arms of the others is found with the physical figure (`carried`): arms move
    the centre of mass, so flights of a clip are ballistic only with its own arms.
    """
    return next((i for i, clip in enumerate(clips) if longest_flight(clip) == 0.0), 0)


def lap_suits_blend(clips: Sequence[Clip], loops: Sequence[Loop], lap: float) -> bool:
    """Whether a lap [s] plays all clips near enough to their own pace to be blended; flights have tighter limits."""
    paces = [loop.duration / lap for loop in loops]
    any_flight = any(longest_flight(clip) > 0.0 for clip in clips)
    slowest, fastest = (MIN_FLYING_PACE, MAX_FLYING_PACE) if any_flight else (MIN_PACE, MAX_PACE)
    return all(slowest <= pace <= fastest for pace in paces)


def lap_suits_each(clips: Sequence[Clip], loops: Sequence[Loop], seconds: float) -> bool:
    """Whether a round [s] plays every clip near enough to its own pace to be followed by itself."""
    return all(
        (MIN_FLYING_PACE if longest_flight(clip) > 0.0 else MIN_PACE) <= loop.duration / seconds <= MAX_FLYING_PACE
        for clip, loop in zip(clips, loops, strict=True)
    )


def closed_loops(clips: Sequence[Clip]) -> list[Loop]:
    """The clips as closed loops."""
    return [closed_loop(checked_clip(clip.poses, clip.fps, clip.name), clip.fps) for clip in clips]


def best_lap(clips: Sequence[Clip], timing: int, in_rounds: bool) -> float:
    """Duration of a lap [s] in which the clip of index `timing` plays at its own pace, and the others nearly so.

    If there is no such lap with travelling clips in step, they need not be, as on the maps. `in_rounds` says whether
    the clips may be played in rounds of several laps; long laps are then divided.
    """
    loops = closed_loops(clips)
    loops = [loops[timing], *loops[:timing], *loops[timing + 1 :]]
    lap = natural_lap(loops)
    if not lap_suits_blend(clips, fit_to_lap(loops, lap), lap):
        lap = natural_lap(loops, apart=True)
    return round(lap / np.ceil(lap / _MAX_ROUND_LAP) if in_rounds else lap, 6)


def off_pace(
    clips: Sequence[Clip], loops: Sequence[Loop], lap: float, laps: int, timing: int, in_rounds: bool = False
) -> tuple[str, ...]:
    """Remark on clips that laps [s] play much faster or slower than their own pace, as loops made by `fit_to_lap`.

    `laps` is the number of laps in a round, in which each loop is played once; `timing` is the index of the clip whose
    pace an advised lap keeps, `in_rounds` as in `best_lap`.
    """
    paces = {clip.name: loop.duration / (laps * lap) for clip, loop in zip(clips, loops, strict=True)}
    outside = [f"{name} at {pace:.2f}" for name, pace in paces.items() if not MIN_PACE <= pace <= MAX_PACE]
    if not outside:
        return ()
    best = best_lap(clips, timing, in_rounds)
    better = (
        f"--lap {best:.1f} suits them best"
        if abs(best / lap - 1.0) > _LAP_TOLERANCE
        else "no lap suits them all better"
    )
    played = f"a lap of {lap:.1f} s plays" if laps == 1 else f"{laps} laps of {lap:.1f} s play"
    return (f"{played} {', '.join(outside)} times its recorded speed; {better}",)
