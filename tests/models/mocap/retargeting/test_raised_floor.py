"""A body that stands on boxes or stairs, of which the file says nothing, or whose place is in another unit."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.retargeting.retarget_report import floor_remarks
from tests.models.mocap.retargeting.rigs import Rig, write_rig


def climbing(height, first, last):
    """Laps of a walk around a square, from `first` to `last` of the time over a hill of a height [m]."""
    clip = embedded("walk")
    laps, lap = [], clip.poses
    for _ in range(4):
        for _ in range(2):
            laps.append(lap[:-1])
            lap = clip.displacement.moved(lap)
        here = lap[0, :2]
        for degrees in range(6, 96, 6):
            x, y = here - Rotation.from_euler("z", degrees, degrees=True).as_matrix()[:2, :2] @ here
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


def test_a_body_that_climbs_for_most_of_the_time_tells_what_is_up(tmp_path):
    """Not even its rig confirms the vertical, but along any other axis it does not stand at all."""
    report = report_of(climbing(1.5, 0.0, 1.0), tmp_path / "r.bvh", "along X")
    assert report.up == "+Y"
    assert report.confidence > 1.0


def test_a_body_that_climbs_leaning_tells_what_is_up_where_its_rig_stands_so_too(tmp_path):
    leaning = climbing(1.5, 0.0, 1.0)
    turn = Rotation.from_euler("y", 20.0, degrees=True)
    leaning.poses[:, :3] = turn.apply(leaning.poses[:, :3])
    leaning.poses[:, 3:7] = (turn * Rotation.from_quat(leaning.poses[:, 3:7], scalar_first=True)).as_quat(
        scalar_first=True
    )
    assert report_of(leaning, tmp_path / "r.bvh").up == "+Y"
    with pytest.raises(MotionFileError, match="the motion does not tell what is up"):
        report_of(leaning, tmp_path / "r.bvh", "along X")


def test_a_body_that_climbs_higher_than_any_studio_does_not_tell_what_is_up(tmp_path):
    """Its root is in another unit than its bones."""
    write_rig(Rig(zero="along X"), climbing(150.0, 0.0, 1.0), tmp_path / "r.bvh")
    with pytest.raises(MotionFileError, match="the motion does not tell what is up"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize("height", [0.2, 1.0])
def test_a_body_above_the_floor_for_longer_than_a_flight_is_said(height, tmp_path):
    report = report_of(climbing(height, 0.3, 1.0), tmp_path / "r.bvh")
    (said,) = [remark for remark in report.remarks if "above the floor" in remark]
    assert abs(float(said.split("up to ")[1].split(" m ")[0]) - height) < 0.05
    assert "which no flight lasts" in said


@pytest.mark.parametrize("name", ["walk", "jump", "backflip", "run"])
def test_flights_and_steps_are_no_raised_floor(name, tmp_path):
    report = report_of(embedded(name), tmp_path / "r.bvh")
    assert not [remark for remark in report.remarks if "the floor" in remark]


@pytest.mark.parametrize("slower", [4.0, 5.0, 10.0])
def test_flight_that_lasts_too_long_reports_the_true_frame_rate(slower, tmp_path):
    clip = embedded("jump")
    report = report_of(Clip(clip.poses, clip.fps / slower, "slow"), tmp_path / "r.bvh")
    (remark,) = [remark for remark in report.remarks if "no flight lasts" in remark]
    rate = float(remark.split(" there: at ")[1].split(" frames")[0])
    assert rate == pytest.approx(clip.fps, rel=0.2)
    assert "--frame-rate" in remark


def test_feet_that_hang_from_a_root_that_does_not_move_are_told_so():
    clearance = np.where(np.arange(400) < 200, 0.0, 0.3)
    (remark,) = floor_remarks(clearance, np.zeros((400, 3)), 100.0, 0)
    assert "its root does not move in the file" in remark
    (remark,) = floor_remarks(clearance, np.outer(np.arange(400), [0.001, 0.0, 0.0]), 100.0, 0)
    assert "it stands on something" in remark


def test_what_is_beneath_the_floor_is_said_with_its_depth_and_time():
    clearance = np.zeros(200)
    clearance[50:60] = -0.28
    assert list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 100.0, 0)) == [
        "parts of the body are up to 0.28 m beneath the floor, for 0.1 s (the first at 0.50 s); "
        "see whether the file has it so"
    ]
    clearance[50:60] = -0.09
    assert not list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 100.0, 0))


def test_hops_that_follow_each_other_are_no_raised_floor():
    """Each of them lasts less than a second, however many there are."""
    clearance = np.tile(np.concatenate((np.full(90, 0.3), np.zeros(10))), 5)
    assert not list(floor_remarks(clearance, np.zeros((len(clearance), 3)), 100.0, 0))
