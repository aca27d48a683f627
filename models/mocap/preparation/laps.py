r"""Extraction of one lap (gait cycle) from a captured walk: the part of a clip that repeats itself best.

A capture begins and ends at any phase of the gait, and closing it by a blend over its ends makes the feet skate there.
The distance of two frames i < j is

.. math:: d_{ij}^2 = \tfrac1{18}\,\bigl(\textstyle\sum_k \angle(q_{ik}, q_{jk})^2 + (z_i - z_j)^2/r^2
          + \tau^2 \|\omega_i - \omega_j\|^2 + \tau^2 \|v_i - v_j\|^2/r^2\bigr)

with the rotations of root (without its heading) and joints, the root's height, and their velocities relative to the
heading (Kovar, Gleicher & Pighin 2002, "Motion graphs"). The lap is the pair of least distance among the pairs between
which the figure travels and both feet step, and in which a foot that stands in both frames has one place relative to
the root: as a mean over all joints, d hardly shows a foot that would have to slide across the seam.
"""

from typing import NamedTuple

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, IntArray, Mask
from models.mocap.dynamics.contacts import contacts
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from models.mocap.motion.kinematics import sole_points

# [s] τ, [m] r: half or twice r changes no loop of 19 captures. τ matters: half the value loops two of them differently
# and moves the ends of five others; twice leaves a run and a skip open, and closes another run by half strides.
_TIME_SCALE, _LENGTH_SCALE = 0.1, 0.5
_MIN_LAP_DURATION = 0.4  # least duration of a lap [s]: a sprinter's stride takes 0.44; half changes none of 17 captures
# Least travel of a lap [m] and largest change of heading in it [rad]; `controllers.haptic_map.led` requires the same.
# Half or twice the first, and twice the second, change no lap of 17 captures; with 15° a hop on the spot has none.
MIN_LAP_TRAVEL, MAX_LAP_TURN = 0.5, np.deg2rad(30.0)
# Largest distance between the places of a foot that stands at both ends of a lap [m]. Of eight captures with 6 to 15 cm
# the feet of three crossed the floor at the seam, by 9 to 23 cm within 0.4 s. Of 119 captures five are looped otherwise
# than without a bound; of 84 of them two, one with 12 cm, five with 6 and 16 with 3, whose seams are often worse.
MAX_FOOT_GAP = 0.08
_MAX_COMPARED_FRAMES = 1200  # largest number of frames that are compared with each other: their matrix takes 12 MB


class Lap(NamedTuple):
    """A lap, and its place in the clip.

    Attributes
    ----------
    clip : Clip
        The frames of the lap.
    start, end : float
        Times in the original clip [s].
    gap : float
        d between its ends [rad].
    """

    clip: Clip
    start: float
    end: float
    gap: float


def best_lap(clip: Clip) -> Lap:
    """The part of a clip that repeats itself best; the clip itself if it closes, or if no part of it is a lap."""
    whole = Lap(clip, 0.0, clip.duration, 0.0)
    if clip.closes(CLOSURE_TOLERANCE) or clip.n_frames < 3:
        return whole
    frame_step = -(-clip.n_frames // _MAX_COMPARED_FRAMES)
    frames = np.arange(0, clip.n_frames, frame_step)
    distances, headings = frame_distances(clip, frames)
    travel = np.linalg.norm(clip.poses[frames, None, :2] - clip.poses[None, frames, :2], axis=2)
    turn = np.abs(headings[:, None] - headings)
    later = frames[None, :] - frames[:, None]
    lap = (later >= _MIN_LAP_DURATION * clip.fps) & (travel >= MIN_LAP_TRAVEL) & (turn <= MAX_LAP_TURN)
    planted = contacts(clip).planted
    for foot in range(planted.shape[1]):
        stance_frames = np.concatenate([[0], np.cumsum(planted[:, foot])])[frames]
        between = stance_frames[None, :] - stance_frames[:, None]
        lap &= (between > 0) & (between < later)
    if not lap.any():
        return whole
    in_place = lap & (foot_gaps(clip, planted, frames) < MAX_FOOT_GAP)
    lap = in_place if in_place.any() else lap
    i, j = np.unravel_index(int(np.argmin(np.where(lap, distances, np.inf))), lap.shape)
    first, last = int(frames[i]), int(frames[j])
    part = Clip(clip.poses[first : last + 1], clip.fps, clip.name)
    return Lap(part, first / clip.fps, last / clip.fps, float(distances[i, j]))


def frame_distances(clip: Clip, frames: IntArray) -> tuple[Array, Array]:
    """Distances d between frames [rad], shape (n, n), and unwrapped headings [rad], shape (n,)."""
    poses, velocities = clip.poses[frames], clip.velocities()[frames]
    heading = 2.0 * np.arctan2(poses[:, 6], poses[:, 3])
    turn = quaternions.about_axis(2, -heading)
    rotations = poses[:, 3:].reshape(len(poses), -1, 4).copy()
    rotations[:, 0] = quaternions.product(turn, rotations[:, 0])
    rotations = quaternions.sign_continuous(rotations).reshape(len(poses), -1)
    # The angle between nearby rotations is twice the distance of their quaternions.
    parts = [2.0 * rotations, poses[:, 2:3] / _LENGTH_SCALE, _TIME_SCALE * velocities[:, 3:]]
    features = np.concatenate(
        [*parts, _TIME_SCALE / _LENGTH_SCALE * quaternions.rotated(turn, velocities[:, :3])], axis=1
    )
    squares = (features**2).sum(axis=1)
    distance = np.maximum(squares[:, None] + squares - 2.0 * features @ features.T, 0.0)
    return np.sqrt(distance / rotations.shape[1] * 4.0), quaternions.without_jumps(heading, poses[:, 3:7])


def foot_gaps(clip: Clip, planted: Mask, frames: IntArray) -> Array:
    """Largest distance between the places of a foot that is planted in two frames [m], shape (n, n); 0 without one.

    Places are horizontal, relative to the root and its heading, which a closed lap makes agree at its ends.
    """
    poses = clip.poses[frames]
    levers = sole_points(poses).reshape(len(frames), 2, 4, 3).mean(axis=2) - poses[:, None, :3]
    turn = quaternions.about_axis(2, -quaternions.heading(poses[:, 3:7]))
    places = quaternions.rotated(turn[:, None], levers)[:, :, :2]
    gaps = np.zeros((len(frames), len(frames)))
    for foot in range(2):
        stands = planted[frames, foot]
        apart = np.linalg.norm(places[:, None, foot] - places[None, :, foot], axis=2)
        np.maximum(gaps, np.where(stands[:, None] & stands, apart, 0.0), out=gaps)
    return gaps
