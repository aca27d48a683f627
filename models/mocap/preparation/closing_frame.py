"""Laps without their closing frame: programs that repeat a lap store each of its poses once, not the first again."""

from dataclasses import replace

import numpy as np

from geometry import quaternions
from geometry.arrays import rms
from models.mocap.motion.clip import Clip, PlanarDisplacement, pose_difference

_MIN_FRAME_COUNT = 10  # least number of frames of a lap: few poses tell no motion
# Largest RMS distance over the joints of the step from the last pose to the first from the mean of the first and the
# last step, relative to that mean. Of 314 captures, pages and variants four laps (a walk, a run, two more) have 0.18 to
# 0.52, all others 0.77 and more; 1 where the closing frame is there, or where a motion ends elsewhere.
_MAX_DEPARTURE = 0.6
_MIN_STEP = 1e-3  # least mean step, RMS over the joints [rad]: a pose that is held is no lap; those laps have 0.006


def with_closing_frame(clip: Clip) -> Clip:
    r"""The clip with its first pose again at its end, if the motion goes on to it from the last one; else unchanged.

    A lap goes on evenly over its seam: with poses :math:`q_0 \ldots q_{n-1}`,

    .. math:: q_0 \ominus q_{n-1} \approx \tfrac12 \left((q_{n-1} \ominus q_{n-2}) + (q_1 \ominus q_0)\right)

    up to the third order of the time step in the joints. The body's place and heading change as in the mean of the two
    steps.
    """
    poses = clip.poses
    if clip.n_frames < _MIN_FRAME_COUNT:
        return clip
    last, first = pose_difference(poses[[-2, 0]], poses[[-1, 1]])
    usual = (last + first)[6:] / 2.0
    departure = rms(pose_difference(poses[-1], poses[0])[6:] - usual)
    if rms(usual) < _MIN_STEP or departure > _MAX_DEPARTURE * rms(usual):
        return clip
    turns = [Clip(ends, clip.fps, clip.name).displacement.yaw for ends in (poses[-2:], poses[:2])]
    yaw = clip.displacement.yaw + (turns[0] + turns[1]) / 2.0
    step = (last[:3] + quaternions.rotated(quaternions.about_axis(2, np.array(yaw)), first[:3])) / 2.0
    closing = PlanarDisplacement(0.0, 0.0, yaw).moved(poses[0])
    closing[:2] = poses[-1, :2] + step[:2]
    return replace(clip, poses=np.vstack((poses, closing)))
