"""A simulated hand that turns the stylus: wanted turn, moment, motion of the stylus, and replay."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from experiments.config.options import run_config
from experiments.setups.wiring import wire
from models.humanoid.skeleton import rest_pose
from models.world.scene import PHANTOM
from sim.errors import SimError
from sim.loop.channels import make_logs, tick_channels
from sim.loop.servo import run_block
from sim.users.hand.actions import Turn, turn_table
from sim.users.hand.arm import Arm
from sim.users.hand.fingers import turning_moment, wanted_turn
from sim.world.phantom_port import phantom_port, true_turn
from sim.world.world import World
from tests.sim.bare_servos import SteppedPhantom

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
START = np.array([0.03, 0.02, 0.04])
TURNS = (Turn(0.05, 0.4, 0.7, (0.0, 0.0, 2.0)), Turn(0.15, 0.5, -0.5, (1.0, 1.0, 0.0)))


def rotation(q):
    return Rotation.from_quat(np.roll(q, -1))


def wanted(turns, t):
    turn, rate = np.empty(3), np.empty(3)
    wanted_turn(turn_table(turns), t, turn, rate)
    return turn, rate


def test_wanted_turn_goes_there_and_back_and_its_rate_is_its_derivative():
    turn = Turn(1.0, 0.5, 0.8, (0.0, 3.0, 4.0))
    axis = np.array([0.0, 0.6, 0.8])
    for t, share in ((0.0, 0.0), (1.0, 0.0), (1.125, 0.5), (1.25, 1.0), (1.375, 0.5), (1.5, 0.0), (9.0, 0.0)):
        np.testing.assert_allclose(wanted((turn,), t)[0], 0.8 * share * axis, atol=1e-12)
    for t in np.linspace(0.0, 0.7, 30):
        np.testing.assert_allclose(
            wanted(TURNS, t)[1], (wanted(TURNS, t + 1e-6)[0] - wanted(TURNS, t - 1e-6)[0]) / 2e-6, atol=1e-5
        )


def test_moment_is_a_spring_damper_about_the_wanted_turn():
    rng, table, moment, h = np.random.default_rng(0), turn_table(TURNS), np.empty(3), 1e-6
    for t in rng.uniform(0.16, 0.44, 50):
        q, w = Rotation.random(random_state=rng), rng.normal(size=3)
        turning_moment(0.3, 0.02, table, t, np.roll(q.as_quat(), 1), w, moment)
        now, before, after = (Rotation.from_rotvec(wanted(TURNS, s)[0]) for s in (t, t - h, t + h))
        spin = (after * before.inv()).as_rotvec() / (2.0 * h)
        np.testing.assert_allclose(moment, 0.3 * (now * q.inv()).as_rotvec() + 0.02 * (spin - w), atol=1e-6)


def test_sensed_stylus_rotation_equals_the_compiled_world():
    rng, world = np.random.default_rng(1), World()
    model, data = world.model, world.data
    for _ in range(20):
        world.reset(START, rest_pose(), tuple(np.roll(Rotation.random(random_state=rng).as_quat(), 1)))
        rate = rng.normal(size=3)
        names = ("theta1", "theta2", "theta3", "elbow", "twin", "gimbal1", "gimbal2", "gimbal3")
        closed = [*rate, rate[2] - rate[1], rate[1] - rate[2], *rng.normal(size=3)]
        for name, value in zip(names, closed, strict=True):
            data.joint(PHANTOM + name).qvel[0] = value
        mujoco.mj_forward(model, data)
        port, q, w, axes = phantom_port(model, data, 1e-3, 150.0), np.empty(4), np.empty(3), np.empty((3, 3))
        true_turn(port, q, w, axes)
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, data.site(PHANTOM + "tip").id, velocity, 0)
        np.testing.assert_allclose(w, velocity[:3], atol=1e-9)
        np.testing.assert_allclose(rotation(q).as_matrix(), data.site(PHANTOM + "tip").xmat.reshape(3, 3), atol=1e-9)


def test_stylus_starts_in_the_given_orientation():
    world = World()
    q = np.roll(Rotation.from_rotvec([0.3, -0.8, 1.1]).as_quat(), 1)
    world.reset(START, rest_pose(), tuple(q))
    state = SteppedPhantom(world).read()
    assert abs(state.q @ q) == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(state.p, START, atol=5e-5)


def test_stylus_follows_the_wanted_turn_while_its_tip_stays():
    world = World()
    world.reset(START, rest_pose(), UPRIGHT)
    errors, largest = [], 0.0
    phantom = SteppedPhantom(world, Arm(turns=TURNS))
    for k in range(700):
        state = phantom.read()
        target = Rotation.from_rotvec(wanted(TURNS, 1e-3 * k)[0])
        errors.append((rotation(state.q) * target.inv()).magnitude())
        largest = max(largest, rotation(state.q).magnitude())
        assert np.linalg.norm(state.p - START) < 2e-4
        phantom.write(np.zeros(3))
    assert largest > 0.6
    assert max(errors) < np.deg2rad(2.0)
    assert errors[-1] < np.deg2rad(0.2)


def test_run_with_turns_replays_bit_for_bit():
    config = run_config(
        clips=("cheer",), seconds=0.4, turns=TURNS, expressive=True, orientation_stiffness=0.2, orientation_damping=1e-3
    )
    first, second = (wire(config) for _ in range(2))
    ticks, frames = make_logs(first.servo, 400)
    _, again = make_logs(second.servo, 400)
    run_block(first.servo, 0, 400, False, ticks, frames)
    run_block(second.servo, 0, 400, True, ticks, again)
    np.testing.assert_array_equal(first.world.data.qpos, second.world.data.qpos)
    np.testing.assert_array_equal(first.world.data.qvel, second.world.data.qvel)
    np.testing.assert_array_equal(frames.qpos, again.qpos)
    assert ticks.applied.shape == (400, first.servo.plant.substeps, 6)
    assert np.abs(ticks.applied[:, :, 3:]).max() > 1e-3
    # The moment of the field is recorded, although the motors cannot apply it.
    moment = tick_channels(ticks, 400)["field"][:, 3:]
    expected = -0.2 * np.array([rotation(q).as_rotvec() for q in ticks.hand[:, 4:8]]) - 1e-3 * ticks.hand[:, 11:14]
    near = np.linalg.norm(expected, axis=1) > 1e-3
    assert near.any()
    ratio = (moment[near] * expected[near]).sum(axis=1) / (expected[near] ** 2).sum(axis=1)
    # Weakened by the window of a tube of 0.25 m, by no more than 1 % a few millimetres from the curve.
    np.testing.assert_allclose(ratio, 1.0, atol=0.01)
    np.testing.assert_allclose(moment[near], ratio[:, None] * expected[near], atol=1e-9)


@pytest.mark.parametrize(
    "turn",
    [
        {"at": -1.0},
        {"seconds": 0.0},
        {"angle": np.nan},
        {"angle": 4.0},
        {"axis": (0.0, 0.0, 0.0)},
        {"axis": (1.0, 0.0)},
        {"axis": (0.0, np.inf, 0.0)},
    ],
)
def test_invalid_turn_is_refused(turn):
    with pytest.raises((SimError, ParameterError)):
        Turn(**({"at": 0.0, "seconds": 1.0, "angle": 0.5, "axis": (0.0, 0.0, 1.0)} | turn))


def test_invalid_turn_stiffness_is_refused():
    with pytest.raises(SimError, match="turn_stiffness is -1"):
        Arm(turn_stiffness=-1.0)
