"""The vertical of a rig's file: found, or not determined and said so; lying, leaning, sitting and falling bodies."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.physics import GRAVITY
from models.errors import ModelError
from models.mocap.library import load
from models.mocap.motion.clip import Clip
from models.mocap.retargeting.hints import Hints
from tests.models.mocap.retargeting.posed_clips import posed, rotated_about_the_origin
from tests.models.mocap.retargeting.rigs import Rig, at_rate, write_rig


def test_up_axis_is_not_determined_for_a_part_of_a_somersault(motions, tmp_path):
    clip = motions.clip("backflip", 30.0)
    write_rig(Rig(), Clip(clip.poses[30:45], clip.fps, "flight"), tmp_path / "r.bvh")
    with pytest.raises(ModelError, match="the up axis cannot be inferred"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize("up", ["+Y", "+Z"])
def test_up_axis_is_not_determined_for_a_lying_body(up, motions, tmp_path):
    """Taken along the floor, its motion is as consistent as that of a standing body."""
    lying = rotated_about_the_origin(motions.clip("cheer"), "y", -90.0, (0.5, 0.3, 0.05))
    write_rig(Rig(up=up, zero="upright T"), lying, tmp_path / "r.bvh")
    with pytest.raises(ModelError, match=re.escape(f"--up {up} or --up ")):
        load(tmp_path / "r.bvh")


def test_up_axis_of_a_leaning_run_is_found_only_if_the_rig_confirms_it(motions, tmp_path):
    """Its weight is beside its feet; only the axes of the rig's rest pose and of usual floors confirm the vertical."""
    leaning = rotated_about_the_origin(motions.clip("run", 20.0), "x", 15.0)
    write_rig(Rig(zero="upright T"), leaning, tmp_path / "r.bvh")
    assert load(tmp_path / "r.bvh").report.up == "+Y"
    write_rig(Rig(zero="along X"), leaning, tmp_path / "r.bvh")
    with pytest.raises(ModelError, match="the up axis cannot be inferred"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize(("zero", "lowered"), [("upright T", 0.0), ("along X", 0.4), ("along bones Y", 0.4)])
def test_up_axis_is_found_for_a_body_sitting_on_a_chair(zero, lowered, motions, tmp_path):
    """Its weight is behind its feet; thighs alone are across the axis of its rig, or that of a floor at zero."""
    bend = [(f"{side}_{part}", "y", degrees) for side in ("left", "right")
            for part, degrees in (("thigh", -85.0), ("shank", 85.0))]  # fmt: skip
    for up in ("+Y", "+Z"):
        seated = rotated_about_the_origin(posed(bend, motions.clip("cheer")), "x", 0.0, (0.0, 0.0, -lowered))
        write_rig(Rig(up=up, zero=zero), seated, tmp_path / "r.bvh")
        report = load(tmp_path / "r.bvh").report
        assert report.up == up
        assert any("what it sits, hangs or leans on" in remark for remark in report.remarks)
    write_rig(Rig(), motions.clip("squat_dance"), tmp_path / "r.bvh")
    assert not any("what it sits" in remark for remark in load(tmp_path / "r.bvh").report.remarks)


@pytest.mark.parametrize(("axis", "degrees"), [("y", -90.0), ("y", 90.0), ("x", 90.0)])
def test_up_axis_is_not_determined_for_a_swimmer(axis, degrees, motions, tmp_path):
    """Its body is as straight along an axis of the water as a standing one; neither its rig nor a floor is there."""
    swimmer = rotated_about_the_origin(motions.clip("cheer"), axis, degrees, (1.0, 1.0, 1.5))
    write_rig(Rig(up="+Z", zero="random"), swimmer, tmp_path / "r.bvh")
    with pytest.raises(ModelError, match=re.escape("or --up +Z")):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize(("thigh", "shank", "frames"), [(0, 0, 24), (0, 0, 36), (-40, 60, 24), (-40, 60, 36)])
def test_up_axis_is_not_determined_for_a_fall_that_ends_lying(thigh, shank, frames, motions, tmp_path):
    """It is at rest only while lying, which suggests an axis along the floor; but it begins upright, as its rig."""
    clip = motions.clip("cheer", 30.0)
    bend = [(f"{side}_{part}", "y", degrees) for side in ("left", "right")
            for part, degrees in (("thigh", thigh), ("shank", shank))]  # fmt: skip
    fallen = np.clip((np.arange(frames) - 3) / 15.0, 0.0, 1.0)[:, None]
    poses = (1.0 - fallen) * clip.poses[:frames] + fallen * posed(bend, clip).poses[:frames]
    turns = Rotation.from_rotvec(np.pi / 2.0 * fallen**2 * (0.0, 1.0, 0.0))
    poses[:, :3] = turns.apply(poses[:, :3])
    quats = poses[:, 3:].reshape(frames, -1, 4)
    quats /= np.linalg.norm(quats, axis=2, keepdims=True)
    quats[:, 0] = (turns * Rotation.from_quat(quats[:, 0], scalar_first=True)).as_quat(scalar_first=True)
    write_rig(Rig(zero="upright T"), Clip(poses, clip.fps, "fall"), tmp_path / "r.bvh")
    with pytest.raises(ModelError, match=r"up axis cannot be inferred .*; expected .*--up \+Y"):
        load(tmp_path / "r.bvh")
    assert load(tmp_path / "r.bvh", Hints(up="+Y")).report.up == "+Y"


@pytest.mark.parametrize("n_frames", [2, 3])
def test_seat_is_remarked_in_a_file_of_a_few_frames_that_last_a_second(n_frames, motions, tmp_path):
    bend = [(f"{side}_{part}", "y", degrees) for side in ("left", "right")
            for part, degrees in (("thigh", -85.0), ("shank", 85.0))]  # fmt: skip
    seat = posed(bend, motions.clip("cheer"))
    write_rig(Rig(), Clip(seat.poses[:n_frames], 1.0, "seat"), tmp_path / "r.bvh")
    remarks = load(tmp_path / "r.bvh", Hints(up="+Y")).report.remarks
    assert any(f"for {n_frames}.0 s the body's weight is above neither" in remark for remark in remarks)


def test_run_on_a_curve_is_not_said_to_lean_on_something(tmp_path):
    """A body that leans by φ on a curve of the radius v² / (g tan φ) is in balance; on a straight path it is not."""
    run, lean = at_rate("run", 60.0), np.deg2rad(25.0)
    laps, lap = [], run.poses
    for _ in range(4):
        laps.append(lap[:-1])
        lap = run.displacement.moved(lap)
    upright = np.concatenate(laps)
    speed = float(np.linalg.norm(run.displacement.moved(run.poses[:1])[0, :2] - run.poses[0, :2])) / run.duration
    radius = speed**2 / (GRAVITY * np.tan(lean))
    along = np.arange(len(upright)) / run.fps * speed
    inwards = Rotation.from_euler("x", -np.rad2deg(lean), degrees=True)

    def leaning(turns, centre):
        turned = (turns * inwards * Rotation.from_quat(upright[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
        places = centre + turns.apply(inwards.apply(upright[:, :3] - np.outer(along, np.eye(3)[0])))
        return Clip(np.column_stack((places, turned, upright[:, 7:])), run.fps, "run")

    around = Rotation.from_euler("z", along[:, None] / radius)
    curve = around.apply([0.0, -radius, 0.0])
    straight = np.outer(along, np.eye(3)[0])
    for turns, centre, leans in ((around, curve, False), (Rotation.identity(len(along)), straight, True)):
        write_rig(Rig(zero="upright T"), leaning(turns, centre), tmp_path / "r.bvh")
        remarks = load(tmp_path / "r.bvh", Hints(up="+Y")).report.remarks
        assert any("what it sits, hangs or leans on" in remark for remark in remarks) == leans
