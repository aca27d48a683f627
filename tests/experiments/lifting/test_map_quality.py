"""Measures of map quality on maps whose separation, conditioning and smoothness are known in closed form."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from controllers.haptic_map.base import HapticMap
from experiments.lifting.map_quality import (
    N_SAMPLES,
    Layout,
    body_weights,
    in_between,
    lap_times,
    measure_map,
    measure_motion,
)
from models.humanoid.skeleton import JOINTS, N_TANGENT, figure_model, joint_range, rest_pose
from models.mocap.motion.clip import Clip

TURN = 2.0 * np.pi
ELBOW = 1 + JOINTS.index("left_elbow")
STANDING = Clip(np.tile(rest_pose(), (60, 1)), 60.0, "standing")


class KnownMap(HapticMap):
    """A map of one constant pose, whose derivative is a given function of the stylus position."""

    def __init__(self, derivative):
        self.derivative, self.seen = derivative, []

    def pose(self, x, memory=None):
        self.seen.append(x.copy())
        return rest_pose()

    def jacobian(self, x, memory=None):
        jacobian = np.zeros((N_TANGENT, 6))
        jacobian[:, :3] = self.derivative(x[:3])
        return jacobian


def rows(moves, turns):
    """Derivative (57, 3) of a root that moves by (3, 3) and a left elbow that turns by (3, 3)."""
    result = np.zeros((N_TANGENT, 3))
    result[:3], result[3 + 3 * ELBOW : 6 + 3 * ELBOW] = moves, turns
    return result


def layout(derivative, sites, durations=None):
    sites = np.asarray(sites, dtype=float)
    sites = np.tile(sites, (N_SAMPLES, 1, 1)) if sites.ndim == 2 else sites
    share = np.arange(N_SAMPLES + 1)[:, None] / N_SAMPLES
    durations = np.ones(sites.shape[1]) if durations is None else durations
    names = tuple(f"clip {i}" for i in range(sites.shape[1]))
    return Layout(KnownMap(derivative), names, sites, share * durations)


def measured(known):
    return measure_map(known, (STANDING,), np.random.default_rng(3))


def test_joint_weights_match_the_mass_matrix():
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos = rest_pose()
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    moments = (np.diag(mass) - model.dof_armature)[3:].reshape(-1, 3).mean(axis=1)
    total = model.body_mass.sum()
    # The root's are about the pelvis; the body turns about its centre of mass.
    moments[0] -= 2.0 / 3.0 * total * ((data.subtree_com[1] - data.xpos[1]) ** 2).sum()
    np.testing.assert_allclose(body_weights(), np.sqrt(moments / total), rtol=1e-9)


def test_separation_is_the_least_distance_at_equal_angles():
    angles = TURN * np.arange(N_SAMPLES) / N_SAMPLES
    fixed = np.tile([0.05, 0.0], (N_SAMPLES, 1))
    # Nearest at 90°, where the other is at (0.062, 0.005); smaller distances between different angles do not count.
    other = np.stack([0.072 - 0.01 * np.sin(angles), 0.005 * np.ones(N_SAMPLES)], axis=1)
    quality = measured(layout(lambda p: rows(np.eye(3), np.zeros((3, 3))), np.stack([fixed, other], axis=1)))
    assert quality.separation == pytest.approx(np.hypot(0.012, 0.005), rel=1e-9)


def test_conditioning_weights_joints_by_body_motion():
    weight = body_weights()[ELBOW]
    # A millimetre along each of three axes moves the body by 1, 2 and 5: two of the root's, one of the elbow's.
    turns = np.zeros((3, 3))
    turns[2, 2] = 5.0 / weight
    quality = measured(layout(lambda p: rows(np.diag([1.0, 2.0, 0.0]), turns), [[0.04, 0.0], [0.06, 0.0]]))
    for found in (quality.conditioning, quality.conditioning_between):
        np.testing.assert_allclose(found, 5.0, rtol=1e-9)


def test_conditioning_is_infinite_on_singular_curves():
    # At the curve at r = 40 mm a move along the radius changes nothing, and at the other two it does.
    def derivative(p):
        out = p / max(np.hypot(p[0], p[1]), 1e-9) * [1.0, 1.0, 0.0]
        share = 0.0 if np.hypot(p[0], p[1]) < 0.045 else 1.0
        return rows(np.eye(3) - (1.0 - share) * np.outer(out, out), np.zeros((3, 3)))

    quality = measured(layout(derivative, [[0.04, 0.0], [0.06, 0.0], [0.08, 0.0]]))
    assert quality.conditioning[0] == pytest.approx(1.0)
    assert np.isinf(quality.conditioning[1])
    np.testing.assert_allclose(quality.conditioning_between, 1.0)


def test_roughness_is_relative_change_of_derivative_per_millimetre():
    # h_* = e^{g z} h_*(0) changes by the share g |n_z| a metre in the direction n, and |n_z| is even in [0, 1].
    g = 40.0
    quality = measured(layout(lambda p: np.exp(g * p[2]) * rows(np.eye(3), np.eye(3)), [[0.04, 0.0], [0.06, 0.01]]))
    np.testing.assert_allclose(quality.roughness, (0.5e-3 * g, 0.9e-3 * g), rtol=0.1)
    smooth = measured(layout(lambda p: rows(np.eye(3), np.eye(3)), [[0.04, 0.0], [0.06, 0.01]]))
    assert smooth.roughness == (0.0, 0.0)


def test_in_between_is_midway_with_mean_duration():
    known = layout(lambda p: rows(np.eye(3), np.eye(3)), [[0.04, -0.01], [0.07, 0.02]], np.array([2.0, 4.0]))
    clip = in_between(known, 0, 1)
    assert clip.n_frames / clip.fps == pytest.approx(3.0, rel=1e-9)
    seen = np.array(known.haptic_map.seen[-clip.n_frames :])  # before, the map is checked at the origin
    np.testing.assert_allclose(np.hypot(seen[:, 0], seen[:, 1]), 0.055, rtol=1e-9)
    np.testing.assert_allclose(seen[:, 2], 0.005, atol=1e-12)
    angles = np.mod(np.arctan2(seen[:, 1], seen[:, 0]), TURN)
    np.testing.assert_allclose(angles, TURN * np.arange(clip.n_frames) / clip.n_frames, atol=1e-9)


@pytest.mark.parametrize("start", [0.0, 1.2, 5.0])
def test_lap_times_of_closed_clip_match_frame_angles(start):
    share, duration = np.linspace(0.0, 1.0, 4001), 2.5
    times = lap_times(start + TURN * (share + 0.1 * np.sin(TURN * share)), duration)

    def share_at(angle):
        return brentq(lambda s: start + TURN * (s + 0.1 * np.sin(TURN * s)) - angle, -2.0, 2.0)

    expected = duration * np.array([share_at(angle) - share_at(0.0) for angle in np.linspace(0.0, TURN, N_SAMPLES + 1)])
    np.testing.assert_allclose(times, expected, atol=1e-6)


def test_lap_times_of_open_clip_cross_the_gap_at_constant_rate():
    # 5 rad in 2 s, so the lap takes as long as at that pace.
    times = lap_times(0.5 + 5.0 * np.linspace(0.0, 1.0, 50), 2.0)
    np.testing.assert_allclose(times, 2.0 / 5.0 * np.linspace(0.0, TURN, N_SAMPLES + 1), atol=1e-12)


def moved(**changes):
    """Measures of a figure at rest with changes per frame: `x` and `z` of the root, bent `knee`."""
    poses = np.tile(rest_pose(), (60, 1))
    poses[:, 0] += changes.get("x", 0.0)
    poses[:, 2] += changes.get("z", 0.0)
    at = 7 + 4 * JOINTS.index("left_knee")
    half = 0.5 * np.asarray(changes.get("knee", 0.0)) * np.ones(60)
    poses[:, at], poses[:, at + 2] = np.cos(half), np.sin(half)
    return measure_motion(Clip(poses, 60.0, "changed"))


def test_motion_faults_are_measured_quantitatively():
    still, s = measure_motion(STANDING), np.linspace(0.0, 1.0, 60)
    np.testing.assert_allclose(still, 0.0, atol=1e-3)
    assert moved(x=0.04 * s).slide == pytest.approx(0.04, abs=1e-9)
    # Out and back: the largest distance counts, not the path length.
    assert moved(x=0.04 * np.sin(TURN * s)).slide == pytest.approx(0.04, rel=1e-2)
    # A foot above the floor does not slide.
    assert moved(x=0.04 * s, z=0.0045).slide == 0.0
    assert moved(z=-0.01).penetration == pytest.approx(still.penetration + 0.01, abs=1e-9)
    limit = joint_range()[JOINTS.index("left_knee"), 1, 1]
    assert moved(knee=limit + 0.2 * s, z=0.5).limits == pytest.approx(0.2, abs=1e-9)
    poses = np.tile(STANDING.poses[0], (10, 1))
    elbow = 7 + 4 * JOINTS.index("left_elbow")
    # Bent by 155° and twisted by 100° it is within its range, though the shorter rotation vector is not.
    poses[:, elbow : elbow + 4] = Rotation.from_rotvec(np.deg2rad([0.0, 100.0, -155.0])).as_quat(scalar_first=True)
    assert measure_motion(Clip(poses, 60.0, "bent")).limits == 0.0
    t = s * 59.0 / 60.0
    assert moved(z=5.0 + 3.0 * t - 0.5 * 9.81 * t**2).ballistic < 1e-3
    assert moved(z=5.0 + 3.0 * t - 0.5 * 9.81 * t**2 + 0.2 * np.sin(3.0 * TURN * s)).ballistic > 0.1
