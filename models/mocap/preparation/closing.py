r"""Closing of a motion: as a lap, by a cross-fade at the seam, or with a way back to its first pose.

Motion a ends at a lap's seam and, moved back to the lap's start, is d away from the motion b that starts there. Both
share d, by a quintic S from 0 at −T to 1 at T:

.. math:: a(t) \oplus S(t)\,d(t) \;\; (t \le 0), \qquad b(t) \oplus (S(t) - 1)\,d(t) \;\; (t \ge 0)

Where the capture goes on beyond both ends this is a cross-fade, and velocities agree at the seam too; where it does
not, as in a file that is one lap, d stays as it is. A closed motion with a foot that always stands returns exactly to
its place: otherwise the foot would skate by the difference in every lap.
"""

import numpy as np

from geometry.easing import smooth_steps
from models.mocap.motion.clip import Clip, PlanarDisplacement, pose_difference
from models.mocap.motion.mirror import mirrored
from models.mocap.preparation.coming_to_rest import REST_TIME, departing
from models.mocap.preparation.poses import add_tangents, smoothed
from models.mocap.preparation.stances import stances

# T [s]: half or twice changes joints of 17 closed captures by 0.4° RMS in the median, 1.1 and 1.2° at most.
_FADE_TIME = 0.25
# Duration of a way back [s], and the addition for each radian of the largest joint rotation [s/rad].
_WAY_BACK_TIMES = (0.6, 1.0)
# A gesture's root ends within this distance [m] and angle [rad] of where it began. Half the distance leaves one of 19
# captures open, twice changes none.
_IN_PLACE_DISTANCE, _IN_PLACE_ANGLE = 0.10, np.deg2rad(15.0)


def closed_lap(clip: Clip, first: int, last: int, half: bool = False) -> Clip:
    """The frames from first to last as a closed lap.

    With `half`, the part ends like the mirror image of its start, and is continued by its own mirror image.
    """
    image = mirrored if half else _identity
    opening, n = image(clip).poses, last - first
    lap = clip.poses[first : last + 1].copy()
    displacement = Clip(np.vstack((opening[first], lap[-1])), clip.fps, clip.name).displacement
    inverse = displacement.inverse()
    width = max(1, int(min(_FADE_TIME * clip.fps, n // 3)))
    frames = np.arange(-width, width + 1)
    captured = np.clip(frames, -first, clip.n_frames - 1 - last)
    apart = pose_difference(inverse.moved(clip.poses[last + captured]), opening[first + captured])
    share = smooth_steps(0.5 + 0.5 * frames / width)[:, None]
    starts = add_tangents(opening[first : first + width + 1], ((share - 1.0) * apart)[width:])
    ends = add_tangents(inverse.moved(lap[n - width :]), (share * apart)[: width + 1])
    lap[: width + 1] = image(Clip(starts, clip.fps, clip.name)).poses
    lap[n - width :] = displacement.moved(ends)
    if half:
        other = image(Clip(lap, clip.fps, clip.name))
        join = Clip(np.vstack((other.poses[0], lap[-1])), clip.fps, clip.name).displacement
        lap = np.vstack((lap, join.moved(other.poses)[1:]))
    lap[-1] = Clip(lap, clip.fps, clip.name).displacement.moved(lap[0])
    result = Clip(lap, clip.fps, clip.name)
    return _without_displacement(result) if is_in_place(result) and _has_standing_foot(result) else result


def with_way_back(clip: Clip) -> Clip:
    r"""The clip and a way back from its last frame to its first, with matching velocities.

    The tangent goes by a quintic from 0 to the difference of both poses. The velocities at its ends decay within
    `REST_TIME`: over a longer way, the noise of a first frame would carry a body that stands far into the air.
    """
    first, last = clip.poses[0] if _has_standing_foot(clip) else clip.displacement.moved(clip.poses[0]), clip.poses[-1]
    difference = pose_difference(last, first)
    largest = float(np.linalg.norm(difference[6:].reshape(-1, 3), axis=1).max())
    n = round((_WAY_BACK_TIMES[0] + _WAY_BACK_TIMES[1] * largest) * clip.fps)
    # At 120 Hz, 8° of noise in a first frame would be 17 rad/s.
    velocities = smoothed(clip).velocities() * REST_TIME
    time = np.arange(1, n + 1)[:, None] / clip.fps
    leaving = departing(np.minimum(time / REST_TIME, 1.0)) * velocities[-1]
    arriving = -departing(np.minimum((n / clip.fps - time) / REST_TIME, 1.0)) * velocities[0]
    ease = smooth_steps(time * clip.fps / n)
    way = add_tangents(np.repeat(last[None], n, axis=0), ease * difference + leaving + arriving)
    way[-1] = first
    return Clip(np.vstack((clip.poses, way)), clip.fps, clip.name)


def is_in_place(clip: Clip) -> bool:
    """Whether the root ends about where it began, with about the same heading."""
    travel = clip.poses[-1, :2] - clip.poses[0, :2]
    return bool(np.hypot(*travel) < _IN_PLACE_DISTANCE and abs(clip.displacement.yaw) < _IN_PLACE_ANGLE)


def _has_standing_foot(clip: Clip) -> bool:
    """Whether one foot stands in every frame."""
    standing = stances(clip, clip).feet.reshape(clip.n_frames, 2, -1)
    return bool(standing.any(axis=2).all(axis=0).any())


def _without_displacement(clip: Clip) -> Clip:
    """The lap without its net displacement, which is removed linearly over the lap."""
    displacement, start = clip.displacement, clip.poses[0, :2]
    travel = clip.poses[-1, :2] - start
    poses = clip.poses.copy()
    for k, fraction in enumerate(np.linspace(0.0, 1.0, clip.n_frames)):
        turned = PlanarDisplacement(0.0, 0.0, -fraction * displacement.yaw)
        moved = clip.poses[k].copy()
        moved[:2] -= start + fraction * travel
        poses[k] = turned.moved(moved)
        poses[k, :2] += start
    poses[-1] = poses[0]
    return Clip(poses, clip.fps, clip.name)


def _identity(clip: Clip) -> Clip:
    return clip
