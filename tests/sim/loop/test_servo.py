"""The compiled tick: sensors, motors, and runs that depend only on their inputs."""

import ctypes
import sys

import numpy as np
import pytest

from controllers.fields.algebra.program import evaluate
from controllers.safety.limiter import limit_force
from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.hands import lap_pushes
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from models.humanoid.skeleton import rest_pose
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import R_HP, jacobian
from models.world.scene import SceneConfig
from sim.errors import SimError
from sim.loop.channels import make_logs, tick_channels
from sim.loop.loop import Loop
from sim.loop.servo import run_block
from sim.users.hand.arm import Arm
from sim.world.encoders import PEAK_TORQUE
from sim.world.phantom_port import actuate, phantom_port, sense, sense_in_motion, true_motion
from sim.world.world import World, phantom_angles
from tests.sim.bare_servos import SteppedPhantom, bare_servo, device_world, simulated

CLIPS = ("cheer", "angry")
CONFIG = run_config(clips=CLIPS, seconds=0.4, user="push", pushes=lap_pushes(0.0, 1.0))


@pytest.fixture(scope="module")
def clips() -> tuple:
    return load_clips(CLIPS)[0]


def session_of(clips: tuple, config: RunConfig = CONFIG) -> Session:
    return wire(config, clips)


def run_logged(session: Session, n: int, replay: bool = False, ticks=None):
    fresh, frames = make_logs(session.servo, n)
    ticks = fresh if ticks is None else ticks
    run_block(session.servo, 0, n, replay, ticks, frames)
    return ticks, frames


def test_sensed_tip_position_is_within_encoder_resolution() -> None:
    world = World()
    for p in ([0.03, 0.02, 0.04], [-0.05, 0.03, -0.02], [0.0, -0.06, 0.05]):
        world.reset(np.array(p), rest_pose())
        port = phantom_port(world.model, world.data, 1e-3, 150.0)
        sense(port, 0.0, 0.0)
        np.testing.assert_allclose(port.hand[1:4], p, atol=5e-5)
        true_p, true_v = np.zeros(3), np.zeros(3)
        true_motion(port, true_p, true_v, np.zeros((3, 3)))
        np.testing.assert_allclose(true_p, p, atol=1e-12)
        site = world.data.site("phantom/tip")
        np.testing.assert_allclose(true_p, site.xpos - world.data.body("phantom/base").xpos, atol=1e-9)
        np.testing.assert_allclose(port.hand[4:8], quaternion_of(site.xmat), atol=2e-3)


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    import mujoco

    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, matrix)
    return quaternion


def test_motor_torques_are_transposed_jacobian_times_force_plus_gravity() -> None:
    world = World()
    world.reset(np.array([0.02, -0.03, 0.04]), rest_pose())
    port = phantom_port(world.model, world.data, 1e-3, 150.0)
    sense(port, 0.0, 0.0)
    force = np.array([0.4, -0.7, 0.9])
    actuate(port, force)
    theta = port.memory[:3]
    expected = np.array(jacobian(theta)).T @ (np.array(R_HP).T @ force) + np.array(gravity_torques(theta))
    np.testing.assert_allclose(port.torque, expected, rtol=1e-12)
    np.testing.assert_array_equal(world.data.ctrl[list(port.motor)], port.torque)


def test_motor_torques_are_limited_to_peak_torque() -> None:
    world = World()
    world.reset(np.array([0.02, -0.03, 0.04]), rest_pose())
    port = phantom_port(world.model, world.data, 1e-3, 150.0)
    sense(port, 0.0, 0.0)
    actuate(port, np.array([1e3, -1e3, 1e3]))
    assert np.all(np.abs(port.torque) <= PEAK_TORQUE)
    assert np.any(np.abs(port.torque) == PEAK_TORQUE)


def test_stylus_without_force_floats() -> None:
    """Gravity compensation keeps it within a tenth of a millimetre for half a second."""
    world = World()
    start = np.array([0.03, 0.02, 0.02])
    world.reset(start, rest_pose())
    phantom = SteppedPhantom(world)
    for _ in range(500):
        state = phantom.read()
        phantom.write(np.zeros(3))
    assert np.linalg.norm(state.p - start) < 1e-4


def test_recorded_run_replays_bit_for_bit(clips: tuple) -> None:
    first, second = session_of(clips), session_of(clips)
    ticks, frames = run_logged(first, 400)
    _, again = run_logged(second, 400, replay=True, ticks=ticks)
    np.testing.assert_array_equal(first.world.data.qpos, second.world.data.qpos)
    np.testing.assert_array_equal(first.world.data.qvel, second.world.data.qvel)
    np.testing.assert_array_equal(frames.qpos, again.qpos)


def test_run_depends_only_on_configuration_and_seed(clips: tuple) -> None:
    def trace(seed: int) -> dict:
        config = run_config(clips=CLIPS, seconds=0.2, seed=seed)
        ticks, _ = run_logged(wire(config, clips), 200)
        return tick_channels(ticks, 200)

    first, same, other = trace(3), trace(3), trace(4)
    for name, block in first.items():
        np.testing.assert_array_equal(block, same[name], err_msg=name)
    assert not np.array_equal(first["p"], other["p"])


def test_block_size_does_not_change_the_result(clips: tuple) -> None:
    """A run in one block and in several blocks are equal bit for bit."""
    whole, pieces = session_of(clips), session_of(clips)
    run_logged(whole, 400)
    blocks: list[int] = []
    Loop(pieces.servo, pieces.world, lambda ticks, frames, n: blocks.append(n)).run(0.4)
    assert len(blocks) > 1
    np.testing.assert_array_equal(whole.world.data.qpos, pieces.world.data.qpos)


def test_device_called_from_python_matches_the_compiled_loop(clips: tuple) -> None:
    """Read, evaluate, limit and write from Python: the same stylus, except for the figure's effect on the solver."""
    compiled, stepped = session_of(clips), session_of(clips)
    ticks, _ = run_logged(compiled, 300)
    arm = Arm(pushes=CONFIG.user.pushes)
    field = stepped.servo.field
    phantom, path = SteppedPhantom(stepped.world, arm, CONFIG.device.cutoff), []
    sense_in_motion(phantom.device.port)
    for _ in range(300):
        hand = phantom.read().vector()
        evaluate(field.units, field.ops, field.params, field.memory, hand, field.wrench)
        limit_force(field.limits, field.limiter, field.wrench, field.force)
        phantom.write(field.force)
        path.append(hand[1:4])
    np.testing.assert_allclose(np.array(path), ticks.hand[:, 1:4], atol=1e-4)


def test_physics_step_that_does_not_divide_the_servo_period_is_refused() -> None:
    with pytest.raises(ValueError, match=r"0\.0003 s does not divide the servo period 0\.001 s"):
        World(SceneConfig(physics_step=3e-4))


def test_servo_period_of_several_physics_steps_is_simulated(clips: tuple) -> None:
    config = run_config(clips=CLIPS, seconds=0.1, servo_period=2e-3, physics_step=5e-4)
    session = wire(config, clips)
    run_logged(session, 50)
    assert session.world.data.time == pytest.approx(0.1, abs=1e-9)
    assert session.servo.plant.substeps == 4


@pytest.mark.parametrize("p", [[0.5, 0.0, 0.0], [0.0, 0.0, 0.6], [0.15, 0.0, 0.0]])
def test_unreachable_point_is_refused_with_its_coordinates(p: list[float]) -> None:
    with pytest.raises(SimError, match=rf"{p[0]:.3f}, {p[1]:.3f}, {p[2]:.3f}"):
        phantom_angles(np.array(p))


def test_ctrl_c_swallowed_by_a_c_callback_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    def block(*_: object) -> None:
        ctypes.CFUNCTYPE(None)(interrupted)()  # which ctypes ignores

    world, before = device_world(), sys.unraisablehook
    loop = Loop(bare_servo(world, simulated(world)), world)
    monkeypatch.setattr("sim.loop.loop.run_block", block)
    for advance in (lambda: loop.run(0.1), loop.step):
        with pytest.raises(KeyboardInterrupt):
            advance()
    assert sys.unraisablehook is before
