"""Soles of a rig's feet: hanging, squatting and walking on the spot, and toes above the floor."""

import numpy as np
import pytest

from geometry import quaternions
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap.library import load
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import global_rotations, sole_points
from models.mocap.retargeting.hints import Hints
from tests.models.mocap.retargeting.posed_clips import posed
from tests.models.mocap.retargeting.rig_comparison import MAX_ANGLE
from tests.models.mocap.retargeting.rigs import Rig, write_rig


@pytest.mark.parametrize("n_frames", [1, 60])
def test_hanging_foot_in_a_pose_that_is_held_is_not_levelled(n_frames, motions, tmp_path):
    """Without other stances to compare with, the toes distinguish a standing from a hanging foot."""
    still = Clip(np.repeat(motions.clip("cheer").poses[:1], n_frames, axis=0), 30.0, "pose")

    def down(clip):
        """Angle of the left toes below the horizontal [°]."""
        ahead = quaternions.rotated(
            global_rotations(clip.poses)[0, BODIES.index("left_foot")], np.array([1.0, 0.0, 0.0])
        )
        return np.rad2deg(np.arcsin(-ahead[2]))

    for shank, hangs in ((18.0, False), (70.0, True)):
        pose = posed([("left_thigh", "y", -30.0), ("left_shank", "y", shank), ("left_foot", "y", 0.0)], still)
        write_rig(Rig(), pose, tmp_path / "r.bvh")
        loaded = load(tmp_path / "r.bvh", Hints(up="+Y"))
        assert down(loaded.clip) == pytest.approx(down(pose), abs=6.0)
        assert any("of the left one none" in remark for remark in loaded.report.remarks) == hangs


@pytest.mark.parametrize(
    ("down", "said"), [(0.0, ""), (20.0, "if the body hangs in the air"), (60.0, "are in line with the shank")]
)
def test_feet_that_hang_still_in_the_air_are_said_to_be_guessed(down, said, motions, tmp_path):
    """As in loops of a fall: their toes are further below them than those of feet that stand, but for high heels."""
    clip = motions.clip("cheer")
    if down:
        clip = posed([(f"{side}_foot", "y", down) for side in ("left", "right")], clip)
    write_rig(Rig(), clip, tmp_path / "r.bvh")
    remarks = "; ".join(load(tmp_path / "r.bvh", Hints(up="+Y")).report.remarks)
    for text in ("if the body hangs in the air", "are in line with the shank"):
        assert (text in remarks) == (text == said)
    assert "does not define the ends" not in remarks


def test_sole_orientation_of_a_squat_on_the_toes_is_remarked_as_a_guess(motions, tmp_path):
    """Its feet are at rest and low but not level: no ankle is bent by 50° on average."""
    squat = [(f"{side}_{part}", "y", degrees) for side in ("left", "right")
             for part, degrees in (("thigh", -80.0), ("shank", 130.0), ("foot", 0.0))]  # fmt: skip
    standing = motions.clip("cheer")
    low = posed(squat, standing).poses[:1] - np.eye(1, standing.poses.shape[1], 2) * 0.5
    both = Clip(np.vstack((standing.poses[:20], np.repeat(low, 40, axis=0))), standing.fps, "squat")
    write_rig(Rig(), both, tmp_path / "r.bvh")
    assert "soles' orientation is estimated" in "; ".join(load(tmp_path / "r.bvh", Hints(up="+Y")).report.remarks)


@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_soles_of_a_walk_in_place_are_level(fps, motions, load_calibrated, tmp_path):
    """As in games: the feet never rest, but move with the ground."""
    walk = motions.clip("walk", fps)
    spot = walk.poses.copy()
    drift = (spot[-1, :2] - spot[0, :2]) / (len(spot) - 1)
    spot[:, :2] -= np.outer(np.arange(len(spot)), drift)
    write_rig(Rig(zero="random", seed=7), walk, tmp_path / "r.bvh")
    over_ground = load_calibrated(tmp_path / "r.bvh", Hints(up="+Y"))
    write_rig(Rig(zero="random", seed=7), Clip(spot, walk.fps, "spot"), tmp_path / "r.bvh")
    on_the_spot = load_calibrated(tmp_path / "r.bvh", Hints(up="+Y"))
    feet = [BODIES.index("left_foot"), BODIES.index("right_foot")]
    apart = quaternions.product(quaternions.conjugate(over_ground.segments[:, feet]), on_the_spot.segments[:, feet])
    assert np.rad2deg(np.linalg.norm(quaternions.logarithm(apart), axis=2)).max() < MAX_ANGLE
    assert "soles" not in on_the_spot.remarks


def test_toes_stay_above_the_floor_for_other_leg_proportions(motions, tmp_path):
    for seed, legs in enumerate(({"thigh": 1.15, "shank": 0.85}, {"thigh": 0.85, "shank": 1.15}, {"foot": 1.15})):
        write_rig(Rig(proportions=legs, seed=seed), motions.clip("squat_dance"), tmp_path / "r.bvh")
        heights = sole_points(load(tmp_path / "r.bvh").clip.poses)[:, :, 2] - CONTACT_RADIUS
        assert np.quantile(heights[:, [2, 3, 6, 7]].min(axis=1), 0.02) > -0.015
