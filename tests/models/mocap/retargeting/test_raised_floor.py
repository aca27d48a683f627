"""Bodies on boxes or stairs that the file does not contain, and root positions in another unit."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.retargeting.retarget_report import floor_remarks
from tests.models.mocap.retargeting.rigs import Rig, write_rig


def climbing(height, first, last):
    """Laps of a walk around a square, over a hill of a height [m] between the shares `first` and `last` of the time."""
    clip = embedded("walk")
    laps, lap = [], clip.poses
    for _ in range(4):
        for _ in range(2):
            laps.append(lap[:-1])
            lap = Clip(lap, clip.fps, "walk").displacement.moved(lap)
        corner = lap[0, :2]
        for degrees in range(6, 96, 6):
            x, y = corner - Rotation.from_euler("z", degrees, degrees=True).as_matrix()[:2, :2] @ corner
            turned = PlanarDisplacement(x, y, np.deg2rad(degrees)).moved(lap)
            laps.append(turned[:1])
        lap = turned
    poses = np.concatenate(laps)
    at = np.clip((np.linspace(0.0, 1.0, len(poses)) - first) / (last - first), 0.0, 1.0)
    poses[:, 2] += height * np.sin(np.pi * at) ** 2
    return Clip(poses, clip.fps, "walk")


def report_of(clip, path, zero="upright T"):
    write_rig(Rig(zero=zero), clip, path)
    return load(path).report


def test_up_axis_is_found_for_a_body_that_climbs_for_most_of_the_time(tmp_path):
    """Even without a rig that confirms the vertical: along any other axis the body does not stand at all."""
    report = report_of(climbing(1.5, 0.0, 1.0), tmp_path / "r.bvh", "along X")
    assert report.up == "+Y"
    assert report.lead > 1.0


def test_up_axis_of_a_leaning_climb_is_found_only_if_the_rig_confirms_it(tmp_path):
    leaning = climbing(1.5, 0.0, 1.0)
    turn = Rotation.from_euler("y", 20.0, degrees=True)
    leaning.poses[:, :3] = turn.apply(leaning.poses[:, :3])
    leaning.poses[:, 3:7] = (turn * Rotation.from_quat(leaning.poses[:, 3:7], scalar_first=True)).as_quat(
        scalar_first=True
    )
    assert report_of(leaning, tmp_path / "r.bvh").up == "+Y"
    with pytest.raises(MotionFileError, match="the up axis cannot be inferred"):
        report_of(leaning, tmp_path / "r.bvh", "along X")


def test_up_axis_is_not_determined_for_a_climb_higher_than_any_studio(tmp_path):
    """Its root is in another unit than its bones."""
    write_rig(Rig(zero="along X"), climbing(150.0, 0.0, 1.0), tmp_path / "r.bvh")
    with pytest.raises(MotionFileError, match="the up axis cannot be inferred"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize(("height", "first", "last"), [(0.2, 0.4, 0.8), (1.0, 0.4, 0.8), (1.0, 0.3, 1.0)])
def test_body_above_the_floor_for_longer_than_a_flight_is_remarked(height, first, last, tmp_path):
    """A hill of 0.2 m from 0.3 to 1.0 is taken for a slope, which is also said."""
    report = report_of(climbing(height, first, last), tmp_path / "r.bvh")
    (floor_remark,) = [remark for remark in report.remarks if "above the floor" in remark]
    assert abs(float(floor_remark.split("up to ")[1].split(" m ")[0]) - height) < 0.05
    assert "longer than any flight" in floor_remark


def test_flight_higher_than_any_jump_is_remarked():
    """Its root is in another unit than its bones: a rise of 2 m within half a second."""
    clearance = np.maximum(2.0 * np.sin(np.linspace(-np.pi, 2.0 * np.pi, 150)), 0.0)
    (remark,) = floor_remarks(clearance, np.zeros((150, 3)), 100.0, 0)
    assert "rises to 2.00 m above the floor, higher than anyone jumps" in remark
    assert not list(floor_remarks(0.6 * clearance, np.zeros((150, 3)), 100.0, 0))


@pytest.mark.parametrize("name", ["walk", "jump", "backflip", "run"])
def test_flights_and_steps_give_no_floor_remark(name, tmp_path):
    report = report_of(embedded(name), tmp_path / "r.bvh")
    assert not [remark for remark in report.remarks if "the floor" in remark]


@pytest.mark.parametrize("slower", [4.0, 5.0, 10.0])
def test_flight_that_lasts_too_long_reports_the_true_frame_rate(slower, tmp_path):
    clip = embedded("jump")
    report = report_of(Clip(clip.poses, clip.fps / slower, "slow"), tmp_path / "r.bvh")
    (remark,) = [remark for remark in report.remarks if "longer than any flight" in remark]
    rate = float(remark.split(" there: at ")[1].split(" frames")[0])
    assert rate == pytest.approx(clip.fps, rel=0.2)
    assert "--frame-rate" in remark


def test_even_rise_of_a_climb_is_no_slow_fall():
    """It bends down by 5 mm in 0.6 m."""
    x = np.linspace(0.0, 1.0, 177)
    root = np.outer(0.6 * x + 0.02 * x * (1.0 - x), [0.0, 0.0, 1.0])
    (remark,) = floor_remarks(np.full(len(x), 0.5), root, 100.0, 0)
    assert "frames a second" not in remark
    assert "it stands on something that is not in the file" in remark


def test_root_that_does_not_move_is_given_as_the_reason_for_hanging_feet():
    clearance = np.where(np.arange(400) < 200, 0.0, 0.3)
    (remark,) = floor_remarks(clearance, np.zeros((400, 3)), 100.0, 0)
    assert "its root does not move in the file" in remark
    (remark,) = floor_remarks(clearance, np.outer(np.arange(400), [0.001, 0.0, 0.0]), 100.0, 0)
    assert "it stands on something" in remark


@pytest.mark.parametrize(("name", "kept"), [("walk", 0.0), ("run", 0.01)])
def test_feet_that_slide_under_a_root_whose_travel_was_taken_out_are_remarked(name, kept, tmp_path):
    clip, poses = embedded(name), embedded(name).poses.copy()
    poses[:, :2] *= kept
    (remark,) = [line for line in report_of(Clip(poses, clip.fps, "r"), tmp_path / "r.bvh").remarks if "slides" in line]
    speed = np.hypot(clip.displacement.x, clip.displacement.y) / clip.duration
    assert float(remark.split("slides at ")[1].split(" m/s")[0]) == pytest.approx(speed, rel=0.35)


@pytest.mark.parametrize("name", ["walk", "run", "squat_dance", "cheer", "angry", "ginga", "jump"])
def test_feet_of_a_body_that_travels_or_stands_are_not_said_to_slide(name, tmp_path):
    assert not [line for line in report_of(embedded(name), tmp_path / "r.bvh").remarks if "slides" in line]


def test_floor_penetration_is_remarked_with_depth_and_time():
    clearance = np.zeros(200)
    clearance[50:60] = -0.28
    assert list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 100.0, 0)) == [
        "parts of the body are up to 0.28 m beneath the floor, for 0.1 s (the first at 0.50 s); check the file"
    ]
    clearance[50:60] = -0.09
    assert not list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 100.0, 0))


def test_consecutive_hops_give_no_floor_remark():
    """Each of them lasts less than a second, for any number of hops."""
    clearance = np.tile(np.concatenate((np.full(90, 0.3), np.zeros(10))), 5)
    assert not list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 100.0, 0))
