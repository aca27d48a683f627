"""Which clips cannot be blended with others, because of long flights, somersaults or joints that go round."""

from collections.abc import Sequence

import numpy as np

from controllers.legs.limbs import Limb
from geometry import quaternions
from geometry.spans import spans
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, JOINTS
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from sim.body.figure_state import FigureGains

MAX_FLIGHT_TIME = 0.3  # [s], 11 cm high: the mean of a longer flight and a motion on the floor is neither
# [rad] a joint that turns farther from its zero goes round, as in 7 of 143 prepared captures: a fault of the capture
_MAX_JOINT_TURN = np.deg2rad(240.0)


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
