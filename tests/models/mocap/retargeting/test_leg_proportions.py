"""Feet that stand in a file stand on the figure, whatever the proportion of thighs and shanks."""

import numpy as np
import pytest

from models.gravity import GRAVITY
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, figure_model, rest_pose
from models.mocap.library import load
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import sole_points
from models.mocap.retargeting import retarget
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.leg_proportions import hips_over_feet
from tests.models.mocap.retargeting.rigs import Rig, leg_scale, write_rig

FPS = 60.0
UP = Hints(up="+Y")
SITS = "between standing and sitting"


def _lengths():
    """Thigh and shank of the figure [m]."""
    model = figure_model()
    return (float(np.linalg.norm(model.body(f"left_{end}").pos)) for end in ("shank", "foot"))


def _sits_and_jumps(proportions):
    """It sits down and stands up, then jumps with its legs drawn up; and the frames in which it flies.

    Its feet stand on the floor in the rig's proportions, not in the figure's.
    """
    thigh, shank = _lengths()
    n, flies = 180, np.arange(130, 154)
    t = np.arange(n) / FPS
    bent = np.sin(np.pi * np.clip(t, 0.0, 1.8) / 1.8) ** 2
    bent[flies] = 0.7 * np.sin(np.pi * (flies - flies[0]) / (len(flies) - 1)) ** 2
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
    since = t[flies] - t[flies[0]]
    height[flies] = 0.5 * GRAVITY * since * (since[-1] - since)
    scale = leg_scale(Rig(proportions=proportions))
    poses[:, 2] += height / scale
    poses[:, 0] -= ahead / scale
    return Clip(poses, FPS, "sits and jumps"), flies


def _read(proportions, folder):
    clip, flies = _sits_and_jumps(proportions)
    write_rig(Rig(proportions=proportions), clip, folder / "r.bvh")
    found = load(folder / "r.bvh", UP)
    heights = sole_points(found.clip.poses)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    return found, heights, flies


@pytest.mark.parametrize(("thigh", "shank"), [(1.2, 0.8), (0.8, 1.2), (1.15, 0.9), (0.85, 1.1)])
def test_feet_stay_on_the_floor_from_standing_to_sitting(thigh, shank, tmp_path):
    found, heights, flies = _read({"thigh": thigh, "shank": shank}, tmp_path)
    stands = np.delete(np.arange(len(heights)), np.arange(flies[0] - 9, flies[-1] + 10))
    assert np.abs(heights[stands]).max() < 0.003
    assert SITS in "; ".join(found.report.remarks)


def test_by_the_hips_own_path_they_would_not(monkeypatch, tmp_path):
    """The experiment that shows that the motions of this module ask for something."""
    monkeypatch.setattr(retarget, "hips_over_feet", lambda root, *_: root)
    for thigh, shank in ((1.2, 0.8), (0.85, 1.1)):
        _, heights, flies = _read({"thigh": thigh, "shank": shank}, tmp_path)
        assert np.ptp(heights[: flies[0] - 10]) > 0.04


def test_a_flight_stays_a_parabola(tmp_path):
    found, _, flies = _read({"thigh": 1.2, "shank": 0.8}, tmp_path)
    inside = flies[10:-10]
    falls = np.diff(found.clip.poses[:, 2], 2)[inside] * FPS**2
    scale = leg_scale(Rig(proportions={"thigh": 1.2, "shank": 0.8}))
    np.testing.assert_allclose(falls, -GRAVITY / scale, rtol=0.01)


@pytest.mark.parametrize("legs", [{}, {"thigh": 1.02, "shank": 0.98}, {"leg": 1.3}])
def test_legs_of_the_figures_proportion_are_left_alone(legs, tmp_path):
    found, _, _ = _read(legs, tmp_path)
    assert SITS not in "; ".join(found.report.remarks)


def test_without_ankles_a_standing_foot_or_a_second_frame_nothing_is_moved():
    root, segments = np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (3, 18, 1))
    ankles = np.full((3, 2, 3), np.nan)
    assert hips_over_feet(root, segments, ankles, ankles, FPS) is root
    flying = np.zeros((3, 2, 3)) + np.arange(3.0)[:, None, None]
    assert hips_over_feet(root, segments, flying, flying, FPS) is root
    assert hips_over_feet(root[:1], segments[:1], flying[:1], flying[:1], FPS) is not None
