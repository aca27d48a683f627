"""Feet that stand in a file stay on the floor for any proportion of thighs to shanks."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.physics import GRAVITY
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, figure_model, rest_pose
from models.mocap.library import load
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from models.mocap.retargeting import retarget
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.leg_proportions import hips_over_feet
from tests.models.mocap.retargeting.rigs import Rig, at_rate, leg_scale, write_rig

FPS = 60.0
UP = Hints(up="+Y")
SITTING_REMARK = "between standing and sitting"
RAISED_REMARK = "of two feet that stand flat in the file, one is up to"


def _leg_lengths():
    """Thigh and shank of the figure [m]."""
    model = figure_model()
    return (float(np.linalg.norm(model.body(f"left_{end}").pos)) for end in ("shank", "foot"))


def _sits_and_jumps(proportions):
    """A clip that sits down, stands up and jumps with drawn-up legs, and the frames of its flight.

    Its feet stand on the floor in the rig's proportions, not in the figure's.
    """
    thigh, shank = _leg_lengths()
    n, flight = 180, np.arange(130, 154)
    t = np.arange(n) / FPS
    bent = np.sin(np.pi * np.clip(t, 0.0, 1.8) / 1.8) ** 2
    bent[flight] = 0.7 * np.sin(np.pi * (flight - flight[0]) / (len(flight) - 1)) ** 2
    thighs, shanks = 1.6 * bent, -0.15 * bent  # forward from the vertical [rad]
    poses = np.tile(rest_pose(), (n, 1))
    local = poses[:, 3:].reshape(n, -1, 4)
    for side in ("left", "right"):
        for part, angle in (("thigh", -thighs), ("shank", thighs - shanks), ("foot", shanks)):
            local[:, BODIES.index(f"{side}_{part}"), 0] = np.cos(angle / 2)
            local[:, BODIES.index(f"{side}_{part}"), 2] = np.sin(angle / 2)
    poses[:, 3:] = local.reshape(n, -1)
    upper, lower = proportions.get("thigh", 1.0) * thigh, proportions.get("shank", 1.0) * shank
    height = upper * (np.cos(thighs) - 1.0) + lower * (np.cos(shanks) - 1.0)
    ahead = upper * np.sin(thighs) + lower * np.sin(shanks)
    since = t[flight] - t[flight[0]]
    height[flight] = 0.5 * GRAVITY * since * (since[-1] - since)
    scale = leg_scale(Rig(proportions=proportions))
    poses[:, 2] += height / scale
    poses[:, 0] -= ahead / scale
    return Clip(poses, FPS, "sits and jumps"), flight


def _load_rig(proportions, folder):
    clip, flight = _sits_and_jumps(proportions)
    write_rig(Rig(proportions=proportions), clip, folder / "r.bvh")
    found = load(folder / "r.bvh", UP)
    heights = sole_points(found.clip.poses)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    return found, heights, flight


@pytest.mark.parametrize(("thigh", "shank"), [(1.2, 0.8), (0.8, 1.2), (1.15, 0.9), (0.85, 1.1)])
def test_feet_stay_on_the_floor_from_standing_to_sitting(thigh, shank, tmp_path):
    found, heights, flight = _load_rig({"thigh": thigh, "shank": shank}, tmp_path)
    standing = np.delete(np.arange(len(heights)), np.arange(flight[0] - 9, flight[-1] + 10))
    assert np.abs(heights[standing]).max() < 0.003
    assert SITTING_REMARK in "; ".join(found.report.remarks)


def test_feet_leave_the_floor_without_the_correction_of_the_hips(monkeypatch, tmp_path):
    """Control experiment: the motions of this module need the correction."""
    monkeypatch.setattr(retarget, "hips_over_feet", lambda root, *_: root)
    for thigh, shank in ((1.2, 0.8), (0.85, 1.1)):
        _, heights, flight = _load_rig({"thigh": thigh, "shank": shank}, tmp_path)
        assert np.ptp(heights[: flight[0] - 10]) > 0.04


def test_flight_stays_a_parabola(tmp_path):
    found, _, flight = _load_rig({"thigh": 1.2, "shank": 0.8}, tmp_path)
    mid_flight = flight[10:-10]
    accelerations = np.diff(found.clip.poses[:, 2], 2)[mid_flight] * FPS**2
    scale = leg_scale(Rig(proportions={"thigh": 1.2, "shank": 0.8}))
    np.testing.assert_allclose(accelerations, -GRAVITY / scale, rtol=0.01)


@pytest.mark.parametrize("legs", [{}, {"thigh": 1.02, "shank": 0.98}, {"leg": 1.3}])
def test_legs_with_the_proportions_of_the_figure_are_not_corrected(legs, tmp_path):
    found, _, _ = _load_rig(legs, tmp_path)
    assert SITTING_REMARK not in "; ".join(found.report.remarks)


def test_root_is_unchanged_without_ankles_standing_feet_or_a_second_frame():
    root, segments = np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (3, 18, 1))
    ankles = np.full((3, 2, 3), np.nan)
    assert hips_over_feet(root, segments, ankles, ankles, FPS) is root
    flying = np.zeros((3, 2, 3)) + np.arange(3.0)[:, None, None]
    assert hips_over_feet(root, segments, flying, flying, FPS) is root
    one_frame = root[:1]
    assert hips_over_feet(one_frame, segments[:1], flying[:1], flying[:1], FPS) is one_frame


@pytest.mark.parametrize(("longer", "said"), [(1.04, False), (1.2, True)])
def test_legs_of_different_lengths_are_remarked(longer, said, tmp_path):
    """With the figure's legs, which are equal, one of two standing feet is in the air."""
    write_rig(Rig(), at_rate("walk", 30.0), tmp_path / "r.bvh")

    def lengthened(match):
        return match[1] + " ".join(str(longer * float(x)) for x in match[2].split())

    text, count = re.subn(r"(JOINT LeftFoot\s*\{\s*OFFSET )(\S+ \S+ \S+)", lengthened, (tmp_path / "r.bvh").read_text())
    assert count == 1
    (tmp_path / "r.bvh").write_text(text)
    remarks = "; ".join(load(tmp_path / "r.bvh", UP).report.remarks)
    thigh, shank = _leg_lengths()
    difference = (longer - 1.0) * shank * (thigh + shank) / (thigh + shank * (1.0 + longer) / 2.0)
    assert (f"the left leg is {100.0 * difference:.0f} cm longer" in remarks) == said
    assert SITTING_REMARK not in remarks


@pytest.mark.parametrize(("hips", "tilt", "said"), [(1.0, 20.0, False), (3.5, 3.0, False), (3.5, 20.0, True)])
def test_foot_that_wide_hips_raise_is_remarked(hips, tilt, said, tmp_path):
    """Hips tilt over a straight and a bent leg; both feet are flat and at one height in the rig."""
    drop = 2.0 * hips * figure_model().body("left_thigh").pos[1] * np.sin(np.deg2rad(tilt))
    bend = np.rad2deg(np.arccos(1.0 - drop / sum(_leg_lengths())))
    level = Rotation.from_euler("x", -tilt, degrees=True)
    turns = {
        "pelvis": level.inv(),
        "abdomen": level,
        "left_thigh": level,
        "right_thigh": level * Rotation.from_euler("y", -bend, degrees=True),
        "right_shank": Rotation.from_euler("y", 2.0 * bend, degrees=True),
        "right_foot": Rotation.from_euler("y", -bend, degrees=True),
    }
    poses = np.tile(rest_pose(), (30, 1))
    local = poses[:, 3:].reshape(30, -1, 4)
    for body, turn in turns.items():
        local[:, BODIES.index(body)] = turn.as_quat(scalar_first=True)
    poses[:, 3:] = local.reshape(30, -1)
    write_rig(Rig(proportions={"hips": hips}), Clip(poses, 30.0, "tilt"), tmp_path / "r.bvh")
    assert (RAISED_REMARK in "; ".join(load(tmp_path / "r.bvh", UP).report.remarks)) == said
