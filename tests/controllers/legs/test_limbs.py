"""Blends whose feet stand: where the ends of limbs are, what pure clips keep, smoothness at the limits of reach."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.legs.limbs import Limb, flexion, place_limb
from tests.controllers.clips_for_maps import LEG, difference, stylus, swinging

R, Z = (0.03, 0.07), (-0.03, 0.03)
STRAIGHT = 0.9  # length of the leg [m]


def rotation(quaternion):
    return Rotation.from_quat(quaternion, scalar_first=True)


def foot(pose):
    """Centre of the sole and orientation of the foot, by forward kinematics."""
    place, turn = pose[:3], rotation(pose[3:7])
    for joint, offset in zip(LEG.joints, LEG.offsets, strict=True):
        place, turn = place + turn.apply(offset), turn * rotation(pose[3 + 4 * joint : 7 + 4 * joint])
    return place + turn.apply(LEG.points.mean(axis=0)), turn


def standing(root, where, heading=0.0):
    """A pose whose sole lies flat at a place of the ground, from law of cosines: root (3,), where (2,)."""
    pose = np.zeros(19)
    pose[:3], pose[3] = root, 1.0
    ankle = np.array([*where, 0.05]) - Rotation.from_euler("z", heading).apply([LEG.points[:, 0].mean(), 0.0, 0.0])
    line = ankle - root - LEG.offsets[0]
    distance = np.linalg.norm(line)
    assert distance < STRAIGHT
    flex = np.pi - np.arccos(1.0 - distance**2 / (2 * 0.45**2))
    # The leg lies in the plane of the line and x: the hip turns −z onto the line, half the flexion ahead of it.
    down = Rotation.align_vectors(line[None], np.array([[0.0, 0.0, -1.0]]))[0]
    hip = down * Rotation.from_euler("y", -flex / 2)
    knee = Rotation.from_euler("y", flex)
    for joint, turn in ((1, hip), (2, knee), (3, (hip * knee).inv() * Rotation.from_euler("z", heading))):
        pose[3 + 4 * joint : 7 + 4 * joint] = turn.as_quat(scalar_first=True)
    return pose


def swaying(where, height, seed):
    """A clip of a root that sways over a foot that stands."""
    rng = np.random.default_rng(seed)
    lap = np.linspace(0.0, 2.0 * np.pi, 61)
    size, lead = rng.uniform(0.02, 0.06, 3), rng.uniform(0.0, 6.0, 3)
    size[2] *= 0.3
    roots = np.array([0.0, 0.0, height]) + size * np.sin(lap[:, None] + lead)
    roots[-1] = roots[0]
    return np.array([standing(root, where) for root in roots]), 30.0


SWAYING = [
    swaying((0.05, 0.1), 0.9, 1), swaying((-0.1, 0.2), 0.6, 2), swaying((0.2, 0.15), 0.75, 3),
    swaying((0.0, 0.05), 0.5, 4),
]  # fmt: skip


def test_a_foot_that_stands_in_all_clips_stands_in_their_blends():
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


def test_clips_alone_are_left_as_they_are():
    clips = [(swinging(seed), 30.0) for seed in (1, 2, 3, 4)]
    for first in range(4):
        # The first clip keeps its own phase, with feet and without.
        turned = clips[first:] + clips[:first]
        with_feet, without = Cylindrical(turned, R, Z, [LEG]), Cylindrical(turned, R, Z)
        for k in range(0, 120, 7):
            x = stylus(R[0], 2.0 * np.pi * k / 120, Z[0])
            np.testing.assert_allclose(difference(with_feet.pose(x), without.pose(x)), 0.0, atol=1e-7)


def stretched(straightness):
    """A map of clips whose leg is nearly, or more than, straight between clips that stand apart."""
    height = 0.05 + STRAIGHT * straightness
    return Cylindrical([swaying((x, 0.1), height, k) for k, x in enumerate((0.05, 0.06, 0.04, 0.055))], R, Z, [LEG])


@pytest.mark.parametrize("h_map", [stretched(0.965), Cylindrical(SWAYING, R, Z, [LEG])], ids=["stretched", "bent"])
def test_the_derivative_agrees_with_differences_also_near_the_limit_of_reach(h_map):
    rng, step, worst = np.random.default_rng(5), 4e-6, 0.0
    for _ in range(120):
        x = stylus(rng.uniform(0.025, 0.075), rng.uniform(0.01, 6.27), rng.uniform(-0.035, 0.035))
        jacobian = h_map.jacobian(x)
        for axis in range(3):
            d = step * np.eye(7)[axis]
            near = difference(h_map.pose(x + d), h_map.pose(x - d)) / (2 * step)
            far = difference(h_map.pose(x + 2 * d), h_map.pose(x - 2 * d)) / (4 * step)
            error = np.abs((4.0 * near - far) / 3.0 - jacobian[:, axis]).max()
            worst = max(worst, error / (1.0 + np.abs(jacobian).max()))
    assert worst < 1e-6


def test_the_flexion_is_the_arc_cosine_and_levels_off_smoothly():
    bent = np.linspace(-0.97, 0.97, 101)
    np.testing.assert_allclose([flexion(c)[0] for c in bent], np.arccos(bent), atol=1e-15)
    c = np.linspace(0.9, 1.6, 7001)
    angle, slope = np.array([flexion(v) for v in c]).T
    assert (np.diff(angle) < 0.0).all()
    assert angle[-1] > 0.03
    np.testing.assert_allclose(slope[1:-1], (angle[2:] - angle[:-2]) / (c[2:] - c[:-2]), rtol=1e-3)
    # C²: f'' has no jump; one of slope alone would be half its size.
    second = np.diff(angle, 2) / 1e-8
    assert np.abs(np.diff(second)).max() < 0.03 * np.abs(second).max()


@settings(max_examples=200)
@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-2.0, 2.0)] * 9))
def test_the_end_is_where_it_should_be_or_as_near_as_the_limb_is_long(target, angles):
    rotations = np.ones((4, 4)) * [1.0, 0.0, 0.0, 0.0]
    rotations[0] = Rotation.from_rotvec(angles[:3]).as_quat(scalar_first=True)
    rotations[1] = Rotation.from_rotvec(angles[3:6]).as_quat(scalar_first=True)
    rotations[2] = Rotation.from_rotvec([0.0, abs(angles[6]), 0.0]).as_quat(scalar_first=True)
    wanted = Rotation.from_rotvec([angles[7], angles[8], 0.3])
    rotations[3] = wanted.as_quat(scalar_first=True)
    pose, root, end = np.zeros(19), np.zeros((1, 3)), np.array([target])
    place_limb(LEG.packed(), rotations, np.empty((4, 3, 0)), root, end, 0)
    pose[3:] = rotations.ravel()
    place, turn = foot(pose)
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=1), 1.0, atol=1e-12)
    assert (turn.inv() * wanted).magnitude() < 1e-7
    ankle = np.array(target) - wanted.apply(LEG.points.mean(axis=0))
    distance = float(np.linalg.norm(ankle - rotation(rotations[0]).apply(LEG.offsets[0])))
    out_of_reach = max(0.0, distance - STRAIGHT, 0.2 - distance)
    if abs(angles[6]) > 0.2:
        assert np.linalg.norm(place - target) < 2e-3 + out_of_reach


def turning(frames=120):
    """A clip that turns round its foot's neighbourhood, a quarter a step: the foot rests between steps."""
    poses = []
    for s in np.linspace(0.0, 1.0, frames + 1):
        quarter, share = divmod(4.0 * s, 1.0)
        ease = np.clip((share - 0.5) / 0.4, 0.0, 1.0)
        ahead = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
        body, heading = 2.0 * np.pi * s, 0.5 * np.pi * (quarter + ahead)
        pose = standing(np.array([0.0, 0.0, 0.8]), np.array([0.02, 0.12]), 0.0)
        # The foot's place in the frame of a body that has turned on by another angle.
        sole = Rotation.from_euler("z", heading - body).apply([0.02, 0.12, 0.0])
        pose = standing(np.array([0.0, 0.0, 0.8]), sole[:2], heading - body)
        pose[3:7] = Rotation.from_euler("z", body).as_quat(scalar_first=True)
        poses.append(pose)
    return np.array(poses), 30.0


def test_a_turning_clip_does_not_drag_the_feet_of_its_blends():
    still = np.array([standing(np.array([0.0, 0.0, 0.85]), (0.05, 0.1))] * 121), 30.0
    h_map = Cylindrical([still, turning(), still, turning()], R, Z, [LEG])
    soles = np.array([foot(h_map.pose(stylus(0.05, 2 * np.pi * s, 0.0)))[0] for s in np.linspace(0.005, 0.995, 400)])
    # Over the ground: before it moves it is lifted.
    speed = np.array([np.linalg.norm((b - a)[:2]) for a, b in pairwise(soles)]) * 400
    resting = (4.0 * np.linspace(0.005, 0.995, 400)[:-1]) % 1.0 < 0.42
    assert speed.max() > 0.3
    assert speed[resting].max() < 0.02 * speed.max()


@pytest.mark.parametrize(
    ("joints", "axis", "says"),
    [
        ((1, 2, 2), (0.0, 1.0, 0.0), "three joints, counted from 1; got"),
        ((0, 1, 2), (0.0, 1.0, 0.0), "three joints, counted from 1; got"),
        ((1, 2, 3), (0.0, 0.0, 2.0), "does not move a limb"),
        ((1, 2, 3), (0.0, np.nan, 1.0), "36 finite numbers"),
    ],
)
def test_what_is_not_a_limb_is_refused(joints, axis, says):
    with pytest.raises(ParameterError, match=says):
        Limb(joints, LEG.offsets, np.array(axis), LEG.points)


def test_a_limb_that_the_poses_do_not_have_is_refused():
    with pytest.raises(ParameterError, match=r"the poses have 3 joints, a limb wants \(1, 2, 4\)"):
        Cylindrical(SWAYING, R, Z, [Limb((1, 2, 4), LEG.offsets, LEG.axis, LEG.points)])
