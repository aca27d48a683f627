"""Limbs of blends: standing feet, unchanged single clips, smoothness at the limits of reach."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.legs.limb_kinematics import flexion, solve_limb
from controllers.legs.limbs import Limb
from tests.controllers.clips_for_maps import LEG, difference, numeric_jacobian, stylus, swinging

R, Z = (0.03, 0.07), (-0.03, 0.03)
LEG_LENGTH = 0.9  # length of the leg [m]


def rotation(quaternion):
    return Rotation.from_quat(quaternion, scalar_first=True)


def foot(pose):
    """Centre of the sole and orientation of the foot, by forward kinematics."""
    position, turn = pose[:3], rotation(pose[3:7])
    for joint, offset in zip(LEG.joints, LEG.offsets, strict=True):
        position, turn = position + turn.apply(offset), turn * rotation(pose[3 + 4 * joint : 7 + 4 * joint])
    return position + turn.apply(LEG.points.mean(axis=0)), turn


def standing(root, position, heading=0.0):
    """A pose whose sole lies flat at a position (2,) of the ground, by the law of cosines, for a root (3,)."""
    pose = np.zeros(19)
    pose[:3], pose[3] = root, 1.0
    ankle = np.array([*position, 0.05]) - Rotation.from_euler("z", heading).apply([LEG.points[:, 0].mean(), 0.0, 0.0])
    line = ankle - root - LEG.offsets[0]
    distance = np.linalg.norm(line)
    assert distance < LEG_LENGTH
    flex = np.pi - np.arccos(1.0 - distance**2 / (2 * 0.45**2))
    # The leg lies in the plane of the line and x: the hip turns −z onto the line, and half the flexion further.
    down = Rotation.align_vectors(line[None], np.array([[0.0, 0.0, -1.0]]))[0]
    hip = down * Rotation.from_euler("y", -flex / 2)
    knee = Rotation.from_euler("y", flex)
    for joint, turn in ((1, hip), (2, knee), (3, (hip * knee).inv() * Rotation.from_euler("z", heading))):
        pose[3 + 4 * joint : 7 + 4 * joint] = turn.as_quat(scalar_first=True)
    return pose


def swaying(position, height, seed):
    """A clip of a root that sways over a standing foot."""
    rng = np.random.default_rng(seed)
    lap = np.linspace(0.0, 2.0 * np.pi, 61)
    size, lead = rng.uniform(0.02, 0.06, 3), rng.uniform(0.0, 6.0, 3)
    size[2] *= 0.3
    roots = np.array([0.0, 0.0, height]) + size * np.sin(lap[:, None] + lead)
    roots[-1] = roots[0]
    return np.array([standing(root, position) for root in roots]), 30.0


SWAYING = [
    swaying((0.05, 0.1), 0.9, 1), swaying((-0.1, 0.2), 0.6, 2), swaying((0.2, 0.15), 0.75, 3),
    swaying((0.0, 0.05), 0.5, 4),
]  # fmt: skip


def test_foot_standing_in_all_clips_stands_in_their_blends():
    with_feet, without = Cylindrical(SWAYING, R, Z, [LEG]), Cylindrical(SWAYING, R, Z)
    for r, z in ((0.04, -0.01), (0.05, 0.0), (0.055, 0.02), (0.062, -0.02)):
        angles = np.linspace(0.01, 6.27, 50)
        soles, turns = zip(*[foot(with_feet.pose(stylus(r, angle, z))) for angle in angles], strict=True)
        np.testing.assert_allclose(soles, [soles[0]] * 50, atol=1e-4)
        np.testing.assert_allclose(np.array(soles)[:, 2], 0.0, atol=1e-4)
        assert max(turn.magnitude() for turn in turns) < 1e-4
        plain = np.array([foot(without.pose(stylus(r, angle, z)))[0] for angle in angles])
        assert np.ptp(plain[:, 0]) > 1e-3
        assert np.abs(plain[:, 2]).max() > 0.01


def test_single_clips_are_unchanged():
    clips = [(swinging(seed), 30.0) for seed in (1, 2, 3, 4)]
    for first in range(4):
        # The first clip keeps its own phase, with feet and without.
        turned = clips[first:] + clips[:first]
        with_feet, without = Cylindrical(turned, R, Z, [LEG]), Cylindrical(turned, R, Z)
        for k in range(0, 120, 7):
            x = stylus(R[0], 2.0 * np.pi * k / 120, Z[0])
            np.testing.assert_allclose(difference(with_feet.pose(x), without.pose(x)), 0.0, atol=1e-7)


def stretched(straightness):
    """A map of clips with different foot positions and nearly straight legs."""
    height = 0.05 + LEG_LENGTH * straightness
    return Cylindrical([swaying((x, 0.1), height, k) for k, x in enumerate((0.05, 0.06, 0.04, 0.055))], R, Z, [LEG])


@pytest.mark.parametrize("h_map", [stretched(0.965), Cylindrical(SWAYING, R, Z, [LEG])], ids=["stretched", "bent"])
def test_jacobian_matches_finite_differences_also_near_the_limit_of_reach(h_map):
    rng, worst = np.random.default_rng(5), 0.0
    for _ in range(120):
        x = stylus(rng.uniform(0.025, 0.075), rng.uniform(0.01, 6.27), rng.uniform(-0.035, 0.035))
        jacobian = h_map.jacobian(x)
        error = np.abs(numeric_jacobian(h_map, x, 4e-6) - jacobian[:, :3]).max()
        worst = max(worst, error / (1.0 + np.abs(jacobian).max()))
    assert worst < 1e-6


def test_flexion_is_the_arc_cosine_and_levels_off_smoothly():
    bent = np.linspace(-0.97, 0.97, 101)
    np.testing.assert_allclose([flexion(c)[0] for c in bent], np.arccos(bent), atol=1e-15)
    c = np.linspace(0.9, 1.6, 7001)
    angle, slope = np.array([flexion(v) for v in c]).T
    assert (np.diff(angle) < 0.0).all()
    assert angle[-1] > 0.03
    np.testing.assert_allclose(slope[1:-1], (angle[2:] - angle[:-2]) / (c[2:] - c[:-2]), rtol=1e-3)
    # C²: f'' has no jump; a kink of f' would give one of half its size.
    second = np.diff(angle, 2) / 1e-8
    assert np.abs(np.diff(second)).max() < 0.03 * np.abs(second).max()


@settings(max_examples=200)
@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-2.0, 2.0)] * 9))
def test_limb_end_reaches_its_target_as_far_as_the_limb_allows(target, angles):
    rotations = np.ones((4, 4)) * [1.0, 0.0, 0.0, 0.0]
    rotations[0] = Rotation.from_rotvec(angles[:3]).as_quat(scalar_first=True)
    rotations[1] = Rotation.from_rotvec(angles[3:6]).as_quat(scalar_first=True)
    rotations[2] = Rotation.from_rotvec([0.0, abs(angles[6]), 0.0]).as_quat(scalar_first=True)
    orientation = Rotation.from_rotvec([angles[7], angles[8], 0.3])
    rotations[3] = orientation.as_quat(scalar_first=True)
    pose, root, end = np.zeros(19), np.zeros((1, 3)), np.array([target])
    solve_limb(LEG.packed(), rotations, np.empty((4, 3, 0)), root, end, 0)
    pose[3:] = rotations.ravel()
    position, turn = foot(pose)
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=1), 1.0, atol=1e-12)
    assert (turn.inv() * orientation).magnitude() < 1e-7
    ankle = np.array(target) - orientation.apply(LEG.points.mean(axis=0))
    distance = float(np.linalg.norm(ankle - rotation(rotations[0]).apply(LEG.offsets[0])))
    out_of_reach = max(0.0, distance - LEG_LENGTH, 0.2 - distance)
    if abs(angles[6]) > 0.2:
        assert np.linalg.norm(position - target) < 2e-3 + out_of_reach


def turning(frames=120):
    """A clip that turns on the spot by a quarter a step, with the foot at rest between steps."""
    poses = []
    for s in np.linspace(0.0, 1.0, frames + 1):
        quarter, share = divmod(4.0 * s, 1.0)
        ease = np.clip((share - 0.5) / 0.4, 0.0, 1.0)
        ahead = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
        body, heading = 2.0 * np.pi * s, 0.5 * np.pi * (quarter + ahead)
        pose = standing(np.array([0.0, 0.0, 0.8]), np.array([0.02, 0.12]), 0.0)
        # The foot in the frame of the body, which has turned by another angle.
        sole = Rotation.from_euler("z", heading - body).apply([0.02, 0.12, 0.0])
        pose = standing(np.array([0.0, 0.0, 0.8]), sole[:2], heading - body)
        pose[3:7] = Rotation.from_euler("z", body).as_quat(scalar_first=True)
        poses.append(pose)
    return np.array(poses), 30.0


def test_turning_clip_does_not_drag_the_feet_of_its_blends():
    still = np.array([standing(np.array([0.0, 0.0, 0.85]), (0.05, 0.1))] * 121), 30.0
    h_map = Cylindrical([still, turning(), still, turning()], R, Z, [LEG])
    soles = np.array([foot(h_map.pose(stylus(0.05, 2 * np.pi * s, 0.0)))[0] for s in np.linspace(0.005, 0.995, 400)])
    # Horizontal speed.
    speed = np.array([np.linalg.norm((b - a)[:2]) for a, b in pairwise(soles)]) * 400
    resting = (4.0 * np.linspace(0.005, 0.995, 400)[:-1]) % 1.0 < 0.42
    assert speed.max() > 0.3
    assert speed[resting].max() < 0.02 * speed.max()


@pytest.mark.parametrize(
    ("joints", "axis", "message"),
    [
        ((1, 2, 2), (0.0, 1.0, 0.0), "three joints, counted from 1; got"),
        ((0, 1, 2), (0.0, 1.0, 0.0), "three joints, counted from 1; got"),
        ((1, 2, 3), (0.0, 0.0, 2.0), "does not move a limb"),
        ((1, 2, 3), (0.0, np.nan, 1.0), "36 finite numbers"),
    ],
)
def test_invalid_limbs_raise_parameter_error(joints, axis, message):
    with pytest.raises(ParameterError, match=message):
        Limb(joints, LEG.offsets, np.array(axis), LEG.points)


def test_limb_with_joints_beyond_the_poses_raises_parameter_error():
    with pytest.raises(ParameterError, match=r"the poses have 3 joints, a limb needs \(1, 2, 4\)"):
        Cylindrical(SWAYING, R, Z, [Limb((1, 2, 4), LEG.offsets, LEG.axis, LEG.points)])
