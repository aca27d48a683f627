import numpy as np
import pytest

from models.humanoid.skeleton import JOINTS, rest_pose
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip
from sim.body.figure import FigureGains
from sim.body.figure_state import REPORT_FLIES, REPORT_RESIDUAL
from sim.body.tracking import TrackingConfig, report, track, tracked_motion
from sim.errors import SimError
from tests.models.mocap.preparation.push_up import held


def _squats() -> Clip:
    """Knee bends once in two seconds, feet flat, arms down."""
    time = np.arange(121) / 60
    bend = 0.3 * (1 - np.cos(np.pi * time))
    poses = np.tile(rest_pose(), (len(time), 1))
    poses[:, 2] -= 0.8606 * (1 - np.cos(bend))
    for side, sign in (("left", 1), ("right", -1)):
        for joint, axis, angle in (
            ("hip", 2, -bend), ("knee", 2, 2 * bend), ("ankle", 2, -bend), ("shoulder", 1, -1.3 * sign * np.ones(121)),
        ):  # fmt: skip
            first = 7 + 4 * JOINTS.index(f"{side}_{joint}")
            poses[:, first], poses[:, first + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return Clip(poses, 60.0, "squats")


def test_feasible_motion_needs_no_residual():
    result = track(_squats(), 2.5)
    assert result.joint_error < 1.0
    assert result.root_error_max < 0.005
    assert result.stance.force_max < 0.01
    # 1 or 0.9992 by a start moved by 1 nm: one update of 1250, and three may be.
    assert result.grounded > 0.997
    assert result.flight_seconds == 0.0
    assert result.warnings == 0


def test_residual_of_an_open_clip_is_not_diluted_by_holding_its_end():
    # A third of a kick that lacks some 10 % of weight.
    angry = embedded("angry")
    part = Clip(angry.poses[: angry.n_frames // 3], angry.fps, "part of angry")
    short, long = track(part, part.duration), track(part, part.duration + 3.0)
    assert short.stance.force_rms > 0.005
    assert long.stance.force_rms == pytest.approx(short.stance.force_rms, rel=1e-2)
    assert long.seconds == pytest.approx(short.seconds + 3.0, abs=0.01)


def test_figure_holds_a_push_up():
    """Load is planned at the palms; they stay on the floor, as nothing else of the hand touches it first."""
    result = track(held(61), 1.0)
    assert result.falls == ()
    assert result.stance.force_rms < 0.02
    assert result.root_error_max < 0.01


def test_lighter_figure_tracks_squats():
    result = track(_squats(), 1.0, TrackingConfig(mass=50.0))
    assert result.joint_error < 1.0
    assert result.stance.force_max < 0.01


def test_walk_stays_within_error_and_residual_bounds():
    result = track(embedded("walk"), 4.0)
    assert result.joint_error <= 5.0
    assert result.root_error_max <= 0.05
    assert result.stance.force_rms <= 0.04  # 0.057 where a foot is not planned to be set down
    assert result.grounded >= 0.99
    assert result.slide <= 0.03
    assert result.warnings == 0


def test_run_flies_without_residual():
    motion = tracked_motion(embedded("run"), 3.0, TrackingConfig())
    result = report(motion)
    assert result.flight_seconds > 0.2
    assert result.residual_in_flight == 0.0
    flies = motion.reports[:, REPORT_FLIES] == 1.0
    assert np.all(motion.reports[flies, REPORT_RESIDUAL : REPORT_RESIDUAL + 6] == 0.0)
    assert result.joint_error <= 5.0
    assert result.root_error_max <= 0.05


@pytest.mark.slow
def test_low_swinging_foot_is_not_taken_for_stance():
    # Backwards and slowly, the walk's heels skim the floor at 5 mm and 1 to 2 m/s.
    walk = embedded("walk")
    clip = Clip(walk.poses[::-1], 0.65 * walk.fps, "walk backwards")
    result = track(clip, 4.0)
    by_height_alone = track(clip, 4.0, TrackingConfig(gains=FigureGains(swing_speed=1e9)))
    assert result.joint_error < 1.5
    assert result.joint_error < 0.5 * by_height_alone.joint_error
    assert result.root_error_max < 0.005


@pytest.mark.parametrize("name", embedded_names())
def test_every_embedded_clip_is_tracked_within_bounds(name):
    """The backflip only until it lands: whether it falls afterwards is chance."""
    result = track(embedded(name), 1.65 if name == "backflip" else 2.0)
    assert result.warnings == 0
    assert result.residual_in_flight == 0.0
    assert result.stance.force_max <= FigureGains().force_bound * (1 + 1e-9)
    assert np.isfinite(result.joint_error)
    assert result.joint_error < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", embedded_names())
def test_every_embedded_clip_is_tracked_for_ten_seconds(name):
    result = track(embedded(name), 10.0)
    assert result.warnings == 0
    assert result.residual_in_flight == 0.0
    if name != "backflip":  # flight is not controlled, so one of several flips in a row may end in a fall
        assert result.joint_error < 10.0
        assert result.root_error < 0.05


def test_infeasible_motion_shows_in_the_residual():
    glide = _squats()
    poses = np.tile(glide.poses[0], (121, 1))
    poses[:, 0] = 0.3 * np.sin(np.arange(121) / 60 * 2 * np.pi * 1.5)  # the whole body slides to and fro, with its feet
    result = track(Clip(poses, 60.0, "glide"), 1.5)
    assert result.stance.force_rms > 0.05 or result.root_error > 0.05


def test_repeated_tracking_is_identical():
    first, second = (tracked_motion(_squats(), 0.5, TrackingConfig()) for _ in range(2))
    np.testing.assert_array_equal(first.poses, second.poses)
    np.testing.assert_array_equal(first.reports, second.reports)


@pytest.mark.parametrize(
    ("arguments", "message"), [({"physics_step": 0.0}, "physics step"), ({"control_steps": 0}, "control every 0")]
)
def test_invalid_step_sizes_are_refused(arguments, message):
    with pytest.raises(SimError, match=message):
        TrackingConfig(**arguments)


def test_negative_duration_is_refused():
    with pytest.raises(SimError, match=r"-1\.0 s of tracking"):
        track(_squats(), -1.0)
