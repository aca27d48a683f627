r"""Looping of captures: as a cycle, with a way back, or open and at rest at both ends.

A part that the rest of the clip only repeats is its cycle (`cycles`), and is closed (`closing`). A gesture, whose root
ends about where it began, gets a way back to its first pose. Half a stride of a gait, whose end is the mirror image of
its start, is continued by its mirror image. Everything else comes to rest at both ends, where a walking body stands
still on its supporting foot and puts the other one beside it (`coming_to_rest`).
"""

from typing import Literal, NamedTuple

import numpy as np

from geometry import quaternions
from models.errors import ModelError
from models.mocap.motion.clip import Clip
from models.mocap.preparation.closing import closed_lap, is_in_place, with_way_back
from models.mocap.preparation.coming_to_rest import REST_TIME, Ending, come_to_rest
from models.mocap.preparation.cycles import LeftOut, find_cycle, find_half_stride, half_stride_instead
from models.mocap.preparation.laps import best_lap, frame_distances
from models.mocap.preparation.poses import smoothed

# Largest gap between the ends of a file that is one lap [rad], [m]: feet are retargeted by what precedes them. The ends
# of seven such files differ by at most 0.007, of 118 others by 0.02 or more.
_LAP_GAP = 0.01
# Largest d between the ends of a clip whose file declares it cyclic [rad]. Of 17 captures, half the value loops a run
# differently, twice closes a backflip and a kick.
_MAX_DECLARED_GAP = 0.45
_MIN_STATED_TIME = 0.2  # least duration of a cycle that is stated [s]
# Speed of the root at both ends above which it cannot be brought to rest quickly [m/s]; none of 19 captures is near it.
_FAST_ROOT_SPEED = 1.0

Kind = Literal["cycle", "half stride", "way back", "open"]


class LostTurn(NamedTuple):
    """Largest distance of a capture's heading from those of its loop repeated [rad], and when it is [s]."""

    angle: float
    at: float


class LoopedClip(NamedTuple):
    """A looped clip.

    Attributes
    ----------
    clip : Clip
        Closed, or at rest at both ends.
    kind : {"cycle", "half stride", "way back", "open"}
        How it was looped.
    start, end : float
        The part of the capture that was used [s]; `start` is negative for an open clip, which begins at rest before it.
    gap : float
        d between its ends before closing [rad].
    lost_turn : LostTurn
        How far the capture turns beyond the loop.
    left_out : LeftOut
        What the capture has and its cycle has not.
    """

    clip: Clip
    kind: Kind
    start: float
    end: float
    gap: float
    lost_turn: LostTurn = LostTurn(0.0, 0.0)
    left_out: LeftOut = LeftOut(0.0, 0.0)


def close_or_rest(
    clip: Clip, wish: str = "auto", wraps: bool | None = None, mirror: bool = False, ending: Ending = "step"
) -> LoopedClip:
    """Close a clip, or bring it to rest at both ends.

    Parameters
    ----------
    clip : Clip
        A capture.
    wish : str
        ``auto``, ``open``, ``lap`` (the part that repeats itself best, however well it does), or the start and end of
        the cycle in seconds, such as ``1.2:2.4``.
    wraps : bool or None
        Whether the file declares itself to be cyclic; None if it says nothing.
    mirror : bool
        Whether half a stride, or START:END, is to be continued by its mirror image.
    ending : {"step", "decay", "limited decay"}
        How an open clip comes to rest: with a last step where it walks, by decay of its velocities, or with joints that
        would leave their ranges stopped in less time.

    Raises
    ------
    ModelError
        If `wish` is none of these or not within the clip, or if the clip has no half stride.
    """
    whole = (0, clip.n_frames - 1)
    if mirror:
        return _close_mirrored(clip, wish)
    if clip.n_frames < 8 or wish == "open":
        return _bring_to_rest(clip, ending)
    if wish == "lap":
        lap = best_lap(clip)
        return _close(clip, round(lap.start * clip.fps), round(lap.end * clip.fps), lap.gap)
    if wish != "auto":
        start, end = _requested_frames(clip, wish)
        return _close(clip, start, end, _gap(clip, start, end))
    if clip.closes():
        return LoopedClip(clip, "cycle", 0.0, clip.duration, 0.0)
    if clip.closes(_LAP_GAP):
        return _close(clip, *whole, 0.0)
    gap = _gap(clip, *whole)
    if wraps and gap < _MAX_DECLARED_GAP:
        return _close(clip, *whole, gap)
    if (cycle := _close_cycle(clip)) is not None:
        return cycle
    if is_in_place(clip):
        return LoopedClip(with_way_back(clip), "way back", 0.0, clip.duration, gap)
    if _is_fast(clip) and (half := find_half_stride(clip)) is not None:
        return _close(clip, half.first, half.last, half.gap, half=True)
    return _bring_to_rest(clip, ending)


def _close_mirrored(clip: Clip, wish: str) -> LoopedClip:
    """The part that the user wishes, or half a stride, continued by its mirror image."""
    if wish != "auto":
        return _close(clip, *_requested_frames(clip, wish), np.nan, half=True)
    if (half := find_half_stride(clip)) is None:
        raise ModelError(f"{clip.name}: --mirror, but no part of it ends like its start mirrored; expected a gait")
    return _close(clip, half.first, half.last, half.gap, half=True)


def _close_cycle(clip: Clip) -> LoopedClip | None:
    """The cycle of the clip, or the half stride that it is, closed; None if there is none."""
    if (cycle := find_cycle(clip)) is None:
        return None
    if (half := half_stride_instead(clip, cycle)) is not None:
        return _close(clip, half.first, half.last, half.gap, half=True)
    return _close(clip, cycle.first, cycle.last, cycle.gap)._replace(left_out=cycle.left_out)


def _requested_frames(clip: Clip, wish: str) -> tuple[int, int]:
    try:
        start, end = (float(part) for part in wish.split(":"))
    except ValueError:
        raise ModelError(f"--loop {wish!r}; expected auto, open, lap, or START:END in seconds") from None
    half_frame = 0.5 / clip.fps
    if not (0.0 <= start <= end - _MIN_STATED_TIME + half_frame and end <= clip.duration + half_frame):
        raise ModelError(
            f"--loop {wish}; expected 0 ≤ START, END {_MIN_STATED_TIME} s later or more, and at {clip.duration:.2f} s "
            "at most, both from the first frame that is kept"
        )
    return round(start * clip.fps), min(round(end * clip.fps), clip.n_frames - 1)


def _gap(clip: Clip, first: int, last: int) -> float:
    """Distance d between two frames [rad]."""
    return float(frame_distances(clip, np.array([first, last]))[0][0, 1])


def _close(clip: Clip, first: int, last: int, gap: float, half: bool = False) -> LoopedClip:
    """The frames from first to last as a closed lap, and how far the capture turns beyond it."""
    kind, times = "half stride" if half else "cycle", (first / clip.fps, last / clip.fps)
    lap = closed_lap(clip, first, last, half)
    return LoopedClip(lap, kind, *times, gap, _lost_turn(clip, first, last, half))


def _lost_turn(clip: Clip, first: int, last: int, half: bool) -> LostTurn:
    """How far headings leave those of a lap, both relative to a heading that turns at the lap's rate.

    A pelvis swings to and fro with the legs: between two phases of a straight walk its heading differs by 40°.
    """
    rotations = clip.poses[:, 3:7]
    headings = quaternions.without_jumps(quaternions.heading(rotations), rotations)
    rate = 0.0 if half else (headings[last] - headings[first]) / (last - first)
    relative = headings - rate * np.arange(clip.n_frames)
    own = relative[first : last + 1]
    if half:
        own = np.concatenate((own, own[0] + own[-1] - own))
    beyond = np.maximum(np.maximum(relative - own.max(), own.min() - relative), 0.0)
    at = int(np.argmax(beyond))
    return LostTurn(float(beyond[at]), at / clip.fps)


def _is_fast(clip: Clip) -> bool:
    """Whether the root moves faster than `_FAST_ROOT_SPEED` at both ends."""
    speeds = np.linalg.norm(clip.velocities()[[0, -1], :2], axis=1)
    return bool(speeds.min() > _FAST_ROOT_SPEED)


def _bring_to_rest(clip: Clip, ending: Ending) -> LoopedClip:
    """The clip with frames added at both ends, in which the body comes to rest with its soles on the floor."""
    if clip.n_frames < 2 or clip.fps * REST_TIME < 2.0:
        return LoopedClip(clip, "open", 0.0, clip.duration, 0.0)
    velocities = smoothed(clip).velocities()  # at 120 Hz, 8° of noise in a first frame would be 17 rad/s
    before = come_to_rest(clip.poses[0], -velocities[0], clip.fps, ending)[::-1]
    after = come_to_rest(clip.poses[-1], velocities[-1], clip.fps, ending)
    poses = np.vstack((before, clip.poses, after))
    start = -len(before) / clip.fps
    return LoopedClip(Clip(poses, clip.fps, clip.name), "open", start, clip.duration, 0.0)
