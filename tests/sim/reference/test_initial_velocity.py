"""A run that begins in motion: stylus and figure start with the given velocities."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from models.humanoid.skeleton import N_TANGENT, rest_pose
from models.world.scene import FIGURE, PHANTOM
from sim.reference.reference import begin_in_motion
from sim.reference.stylus_filter import smooth_hand
from sim.world.phantom_port import phantom_port, sense, sense_in_motion, true_motion
from sim.world.world import World


@pytest.mark.parametrize("v_H", [(0.1, 0.0, 0.0), (-0.05, 0.12, 0.03)])
def test_stylus_starts_with_the_given_velocity(v_H):
    world, p = World(), np.array([0.03, -0.02, 0.02])
    world.reset(p, rest_pose(), None, np.array(v_H))
    port = phantom_port(world.model, world.data, 0.001, 150.0)
    place, velocity = np.empty(3), np.empty(3)
    true_motion(port, place, velocity, np.empty((3, 3)))
    np.testing.assert_allclose(place, p, atol=1e-12)
    np.testing.assert_allclose(velocity, v_H, atol=1e-12)
    # The closed linkage moves with it, otherwise MuJoCo's constraint would act at once.
    rate = {name: world.data.qvel[world.model.joint(PHANTOM + name).dofadr[0]] for name in ("theta2", "theta3")}
    for name, sign in (("elbow", 1.0), ("twin", -1.0)):
        got = world.data.qvel[world.model.joint(PHANTOM + name).dofadr[0]]
        assert got == pytest.approx(sign * (rate["theta3"] - rate["theta2"]), abs=1e-15)


def test_figure_starts_with_the_given_velocity():
    world, rng = World(), np.random.default_rng(2)
    velocity = rng.normal(scale=0.1, size=N_TANGENT)
    pose = rest_pose()
    pose[2] += 1.0
    world.reset(np.array([0.03, 0.0, 0.0]), pose, None, None, velocity)
    root = world.model.joint(FIGURE + "root")
    first = int(root.qposadr[0])
    mujoco.mj_step(world.model, world.data)
    moved = np.empty(N_TANGENT)
    mujoco.mj_differentiatePos(
        world.body, moved, world.model.opt.timestep, pose, world.data.qpos[first : first + len(pose)].copy()
    )
    # Gravity and passive joints change it by no more than a step's share.
    np.testing.assert_allclose(moved[:3], velocity[:3], atol=2e-2)
    assert np.corrcoef(moved, velocity)[0, 1] > 0.9


def test_stylus_and_figure_rest_without_velocities():
    world = World()
    world.reset(np.array([0.03, 0.0, 0.0]), rest_pose())
    assert not world.data.qvel.any()


def test_velocity_estimate_is_right_from_the_first_tick():
    world, p, v_H = World(), np.array([0.03, -0.02, 0.02]), np.array([0.1, -0.05, 0.08])
    errors = []
    for moves in (False, True):
        world.reset(p, rest_pose(), None, v_H)
        port = phantom_port(world.model, world.data, 0.001, 150.0)
        if moves:
            sense_in_motion(port)
        sense(port, 0.0, 0.0)
        assert port.hand[0] == 0.0
        np.testing.assert_allclose(port.hand[1:4], p, atol=5e-5)
        errors.append(np.linalg.norm(port.hand[8:11] - v_H))
    # The error left is one filtered encoder step per period; without `sense_in_motion` the velocity starts at zero.
    assert errors[0] > 0.9 * np.linalg.norm(v_H)
    assert errors[1] < 0.03


def test_stylus_filter_starts_at_the_given_motion():
    lap, period = Trajectory.circle(0.05, 2.0), 0.008
    reference = SimpleNamespace(
        period=period, smoothing=0.7, started=np.zeros(1), hand=np.zeros((3, 3)), trail=np.zeros((2, 3))
    )
    begin_in_motion(reference, np.array([lap.point(0.0), lap.velocity(0.0), lap.acceleration(0.0)]))
    # Its past values are those of the same motion.
    np.testing.assert_allclose(reference.trail[0], lap.point(-2.0 * period), atol=2e-6)
    stylus = np.append(lap.point(0.0), [1.0, 0.0, 0.0, 0.0])
    smooth_hand(reference.hand, stylus[:3], reference.smoothing, period)
    np.testing.assert_allclose(reference.hand, [lap.point(0.0), lap.velocity(0.0), lap.acceleration(0.0)], atol=1e-12)
