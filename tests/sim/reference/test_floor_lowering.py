"""Settling: if the hand holds an animation in the middle of a flight, the figure stands instead of hovering."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.state import stylus_path
from experiments.config.options import run_config
from experiments.fitting.figure_legs import figure_legs, packed_legs
from experiments.setups.modes.stretch import flight_remarks
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.hands import edited_until
from experiments.setups.wiring import wire
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, figure_model
from models.mocap.motion.clip import pose_difference, pose_errors
from models.mocap.motion.kinematics import contact_points
from models.world.scene import FIGURE
from sim.loop.loop import Loop
from sim.loop.servo import FrameLog, TickLog
from sim.reference.floor_lowering import approach, lower_to_floor, lowering_goal
from sim.reference.reference import make_reference, reference_along

FIGURE_MODEL = figure_model()
LEGS, ENDS = packed_legs(FIGURE_MODEL), np.empty((2, 7))
PERIOD, LAP = 8e-3, 2.4


def _poses(name: str) -> np.ndarray:
    return load_clips((name,))[0][0].poses.copy()


def _lowest(poses: np.ndarray) -> np.ndarray:
    """Height of the lowest contact sphere of the feet over the floor [m], by MuJoCo."""
    return contact_points(poses, FOOT_CONTACTS, FIGURE_MODEL)[:, :, 2].min(axis=1) - CONTACT_RADIUS


@pytest.mark.parametrize("name", ["jump", "run"])
def test_flight_poses_are_lowered_to_the_floor_and_stances_unchanged(name: str) -> None:
    poses = _poses(name)
    before, lowered = _lowest(poses), poses.copy()
    for pose in lowered:
        lower_to_floor(LEGS, ENDS, 1.0, pose, 1.0)
    assert before.max() > 0.03
    assert _lowest(lowered).max() < 0.006
    assert _lowest(lowered).min() > before.min() - 1e-9
    stands = before < 0.001
    assert np.abs(lowered - poses)[stands].max() < 1e-4
    # Only the height changes, and nothing with a share of zero.
    np.testing.assert_array_equal(np.delete(lowered, 2, axis=1), np.delete(poses, 2, axis=1))
    for pose, own in zip(lowered, poses, strict=True):
        pose[:] = own
        lower_to_floor(LEGS, ENDS, 0.0, pose, 1.0)
    np.testing.assert_array_equal(lowered, poses)


def test_upside_down_figure_is_not_lowered() -> None:
    poses = _poses("backflip")
    upside_down = poses[1.0 - 2.0 * (poses[:, 4] ** 2 + poses[:, 5] ** 2) < 0.0]
    lowered = upside_down.copy()
    for pose in lowered:
        lower_to_floor(LEGS, ENDS, 1.0, pose, 1.0)
    assert len(upside_down) > 5
    np.testing.assert_array_equal(lowered, upside_down)


def test_lowering_share_falls_to_zero_as_the_hand_reaches_the_clip_pace() -> None:
    p = np.array([0.05, 0.0, 0.02])
    along = 0.05 * 2.0 * np.pi / LAP * np.array([0.0, 1.0, 0.0])
    shares = [lowering_goal(p, pace * along, LAP) for pace in np.linspace(0.0, 1.2, 49)]
    assert shares[0] == 1.0
    assert shares[28] == 1.0  # 0.7 of the pace
    assert max(shares[36:]) < 1e-9  # 0.9 of it
    assert np.all(np.diff(shares) <= 0.0)
    # The other direction counts as well; motion upwards, outwards or on the axis does not.
    assert lowering_goal(p, -along, LAP) < 1e-9
    assert lowering_goal(p, np.array([0.3, 0.0, 0.3]), LAP) == 1.0
    assert lowering_goal(np.zeros(3), along, LAP) == 1.0


def test_share_approaches_its_goal_without_jump_or_overshoot() -> None:
    state, rows = np.zeros(3), []
    for _ in range(125):
        approach(state, 1.0, PERIOD)
        rows.append(state.copy())
    share, rate = np.array(rows)[:, 0], np.array(rows)[:, 1]
    assert np.all(np.diff(share) >= 0.0)
    assert share[-1] == pytest.approx(1.0, abs=1e-3)
    assert share.max() <= 1.0
    np.testing.assert_allclose(np.diff(share) / PERIOD, 0.5 * (rate[1:] + rate[:-1]), atol=0.05)


def _held_in_flight(clip_seconds: float) -> np.ndarray:
    """Poses of a hand that follows a jump and stops in mid-air."""
    poses = _poses("jump")
    clip = load_clips(("jump",))[0][0]
    jumps = Cylindrical([(clip.poses, clip.fps)] * 4, (0.02, 0.08), (-0.025, 0.025), figure_legs(FIGURE_MODEL))
    curve, top = Trajectory.circle(0.05, LAP), LAP * int(_lowest(poses).argmax()) / (len(poses) - 1)
    t = np.minimum(np.arange(round((top + 1.5) / PERIOD)) * PERIOD, top)
    reference = make_reference(
        FIGURE_MODEL, jumps.compiled(), PERIOD, 6.0, limbs=packed_legs(FIGURE_MODEL), clip_seconds=clip_seconds
    )
    settled = np.empty((len(t), 75))
    reference_along(reference, stylus_path(curve.point(t)), np.zeros((len(t), TRACE_SIZE)), settled)
    return settled


@pytest.mark.slow
def test_held_jump_comes_down_and_hovers_without_settling() -> None:
    settled, hovering = _held_in_flight(LAP), _held_in_flight(0.0)
    assert _lowest(hovering)[-1] > 0.2
    assert _lowest(settled)[-1] < 0.006
    # At the clip's pace it flies, and it is lowered no faster than a body falls.
    velocity = pose_difference(settled[:-1], settled[1:])[:, 2] / PERIOD
    assert _lowest(settled).max() > 0.15
    assert velocity.min() > -2.5
    assert np.abs(np.diff(velocity)).max() < 0.5


def test_remarks_name_clips_whose_flights_cannot_be_held() -> None:
    assert flight_remarks(load_clips(("walk", "cheer"))[0], "physical") == ()
    (remark,) = flight_remarks(load_clips(("jump", "run", "walk"))[0], "physical")
    assert "jump, run" in remark
    assert "lowered to the floor, and the figure may fall there" in remark
    assert "upside down" in flight_remarks(load_clips(("backflip",))[0], "physical")[-1]


def test_only_a_physical_figure_is_remarked_to_fall() -> None:
    flying = load_clips(("backflip", "jump"))[0]
    (remark,) = flight_remarks(flying, "kinematic")
    assert remark.endswith("the flights of backflip, jump are lowered to the floor")
    assert flight_remarks(flying, "none") == ()


@pytest.mark.slow
@pytest.mark.parametrize("clips", [("jump",), ("walk", "run", "jump", "angry")])
def test_physical_figure_stands_through_held_and_carried_flights(clips: tuple[str, ...]) -> None:
    config = run_config(clips=clips, mode="stretch-then-follow", seconds=18.0)
    session = wire(config, load_clips(clips)[0])
    root = int(session.world.model.joint(FIGURE + "root").qposadr[0])
    errors: list[float] = []

    def append_errors(ticks: TickLog, frames: FrameLog, n: int) -> None:
        m = -(-n // session.servo.figure_ticks)
        errors.append(float(pose_errors(frames.qpos[:m, root : root + 75], frames.reference[:m])[1].max()))

    Loop(session.servo, session.world, append_errors).run(config.seconds)
    assert config.seconds > edited_until(session.config.user.grabs) + 3.0
    # A figure that does not stand falls at 11.7 s with the jump and at 6.2 s with the four clips.
    assert max(errors) < 0.3
