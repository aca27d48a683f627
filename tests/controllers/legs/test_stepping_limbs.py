"""Stepping limbs: the foot is placed exactly, except where it deviates to avoid jumps of the joints."""

import mujoco
import numpy as np
import pytest

from controllers.legs.footsteps import FLOOR, STEP, limb_end
from controllers.legs.stepping_limbs import required_root_lowering, solve_stepping_limb
from experiments.fitting.figure_legs import packed_legs
from models.humanoid.skeleton import figure_model
from models.mocap.motion.clip import pose_difference

FIGURE = figure_model()
LEG = packed_legs(FIGURE)[0]
KNEE = FIGURE.joint("left_knee").dofadr[0]
LENGTH = sum(np.linalg.norm(LEG[first : first + 3]) for first in (6, 9))
STANDING = np.zeros(STEP)


def _pose() -> np.ndarray:
    """A pose with slightly bent knees, as in clips."""
    pose = FIGURE.qpos0.copy()
    half = 0.4
    for joint, angle in (("left_hip", -half), ("left_knee", 2 * half), ("left_ankle", -half)):
        start = FIGURE.joint(joint).qposadr[0]
        pose[start : start + 4] = [np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0]
    return pose


def _end(pose: np.ndarray) -> np.ndarray:
    end = np.empty(7)
    limb_end(LEG, pose, end)
    return end


def _put(end: np.ndarray, share: float) -> np.ndarray:
    pose = _pose()
    solve_stepping_limb(LEG, pose, end.copy(), share)
    return pose


def _largest_jump(ends: np.ndarray, share: float) -> float:
    """Largest second difference of a joint along a path of the foot, over the time step of 1 ms [rad/s]."""
    poses = np.array([_put(end, share) for end in ends])
    return float(np.abs(np.diff(pose_difference(poses[:-1], poses[1:]), axis=0)).max() / 1e-3)


def _path(start: np.ndarray, velocity: np.ndarray, seconds: float) -> np.ndarray:
    ends = np.tile(start, (round(seconds / 1e-3), 1))
    ends[:, :3] += np.arange(len(ends))[:, None] * 1e-3 * velocity
    return ends


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_reachable_foot_is_placed_exactly(share: float) -> None:
    end = _end(_pose())
    end[:3] += [0.1, 0.02, 0.1]
    np.testing.assert_allclose(_end(_put(end, share))[:3], end[:3], atol=1e-9)


def test_foot_left_behind_does_not_snap_the_knee_straight() -> None:
    # The root moves on at 3 m/s until the foot is far out of reach.
    ends = _path(_end(_pose()), np.array([-3.0, 0.0, 0.0]), 0.3)
    assert _largest_jump(ends, 1.0) < 2.0
    assert _largest_jump(ends, 0.0) > 10.0
    bent = [np.linalg.norm(pose_difference(FIGURE.qpos0, _put(end, 1.0))[KNEE : KNEE + 3]) for end in ends]
    assert min(bent) > 0.2


def test_foot_passing_close_to_its_hip_goes_below_it() -> None:
    hip = np.array([0.0, LEG[4], _pose()[2] + LEG[5]])
    start = _end(_pose())
    start[:3] = hip + np.array([-0.4, 0.02, -0.12])
    ends = _path(start, np.array([4.0, 0.0, 0.0]), 0.2)
    assert _largest_jump(ends, 1.0) < 0.5 * _largest_jump(ends, 0.0)
    ankles = np.array([_end(_put(end, 1.0))[:3] for end in ends])
    assert np.linalg.norm(ankles - hip, axis=1).min() > 0.2 * LENGTH


def test_shortfall_is_the_descent_of_the_root_that_the_leg_needs() -> None:
    pose, step = _pose(), STANDING.copy()
    end = _end(pose)
    data = mujoco.MjData(FIGURE)
    data.qpos[:] = pose
    mujoco.mj_kinematics(FIGURE, data)
    hip, ankle = (data.xanchor[FIGURE.joint(name).id] for name in ("left_hip", "left_ankle"))
    end[0] += 0.3
    end[2] -= 0.05
    step[FLOOR] = end[2]
    line = ankle - hip + [0.3, 0.0, -0.05]
    expected = -line[2] - np.sqrt((0.95 * LENGTH) ** 2 - line[0] ** 2 - line[1] ** 2)
    assert expected > 0.03
    assert required_root_lowering(LEG, step, pose, end) == pytest.approx(expected, abs=0.01)
    # Neither for a foot in the air nor for one within reach.
    step[FLOOR] = end[2] - 0.3
    assert required_root_lowering(LEG, step, pose, end) == 0.0
    assert required_root_lowering(LEG, STANDING, pose, _end(pose)) == 0.0
