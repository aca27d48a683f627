"""Faults of clips that are not well-formed."""

import numpy as np

from models.humanoid.skeleton import JOINTS
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.foot_skate import stance_skates
from models.mocap.motion.kinematics import sole_points
from models.mocap.preparation.poses import add_tangents, resampled
from models.mocap.preparation.stances import stances
from models.mocap.preparation.well_formed import outliers, well_formed


def test_low_moving_sole_part_without_load_does_not_count_as_foot_skate(walks):
    """A toe that rolls off is as low as a standing one."""
    walk = walks[0]
    schedule = stances(walk, walk)
    points = sole_points(walk.poses)
    all_skates = stance_skates(points, schedule.standing)
    assert well_formed(walk, ()).slid < all_skates.max()


def test_feet_that_slide_under_load_are_a_fault_though_they_do_not_stand():
    """As where a loop is closed though its feet are at other places: they cross the floor in a tenth of a second."""
    poses = np.repeat(resampled(embedded("cheer"), 120.0).poses[:1], 240, axis=0)
    poses[:, 0] += 0.4 * np.clip((np.arange(240) - 114) / 12.0, 0.0, 1.0)
    leap = well_formed(Clip(poses, 120.0, "leap"), ())
    assert leap.slid > 0.1
    assert leap.skate > 0.1
    assert any(line.startswith("feet skate by") for line in leap.faults())


def test_sole_below_the_floor_is_a_fault_though_it_does_not_stand(walks):
    walk = walks[0]
    flexed = np.zeros((walk.n_frames, 57))
    swing = sole_points(walk.poses)[:, 4:, 2].min(axis=1) > 0.015
    flexed[swing, 6 + 3 * JOINTS.index("right_ankle") + 1] = np.deg2rad(70.0)
    sunk = well_formed(Clip(add_tangents(walk.poses, flexed), walk.fps, "sunk"), ())
    assert sunk.depth > 0.03
    assert any("below the floor; 10 at most" in line for line in sunk.faults())
    assert well_formed(walk, ()).depth < 0.003


def test_embedded_walk_is_well_formed(walks):
    assert well_formed(walks[0], ()).faults() == ()


def test_pose_foreign_to_the_motion_is_an_outlier(walks):
    poses = walks[0].poses.copy()
    poses[20, 3:] = np.tile([1.0, 0, 0, 0], 18)
    assert outliers(walks[0]) == 0
    assert outliers(Clip(poses, 120.0, "popped")) >= 1
