"""The lifted map: every clip exact on its own curve, and legs of one clip with arms of others."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.frames import closing_gap, frames_at, interpolate_frames, lap_spline, packed_frames
from tests.controllers.clips_for_maps import LEG, difference, stylus
from tests.controllers.example_maps import (
    ANGLES,
    ARM_JOINTS,
    CLOSED,
    LIFTED,
    LIFTED_CLIPS,
    TURN,
    WITHOUT_LIMBS,
    angles_once_round,
    ring,
)


def worst_at_frames(lifted):
    """Largest difference [m, rad] between h along the curves and the clips, at all frames."""
    worst = 0.0
    for i in range(len(lifted.clips)):
        curve, memory = lifted.curve(i), lifted.compiled().memory
        for k, pose in enumerate(lifted.placed(i)):
            x = np.append(curve.point(k / lifted.clips[i][1]), [1.0, 0.0, 0.0, 0.0])
            worst = max(worst, np.abs(difference(lifted.pose(x, memory), pose)).max())
    return worst


def test_every_frame_of_every_clip_is_exact_on_its_curve():
    assert worst_at_frames(LIFTED) < 1e-9


@pytest.mark.parametrize("i", range(4))
def test_frames_at_many_angles_are_identical_to_the_kernel(i):
    clip = LIFTED._placed_clips[i]
    spline = lap_spline(clip.angles, clip.remainder, 4, clip.closed)
    angles = np.concatenate([np.linspace(0.0, TURN, 200), np.mod(spline[0], TURN), [np.nextafter(TURN, 0.0)]])
    packed, value, slope = packed_frames([spline]), *np.empty((2, clip.poses.shape[1]))
    for angle, row in zip(angles, frames_at(spline, angles), strict=True):
        interpolate_frames(packed, 0, angle, value, slope)
        np.testing.assert_array_equal(row, value)


def test_clips_are_displaced_rigidly_over_the_ground():
    for i, (poses, _) in enumerate(LIFTED_CLIPS):
        placed = LIFTED.placed(i)
        np.testing.assert_array_equal(placed[:, 2], poses[:, 2])
        np.testing.assert_allclose(np.abs(placed[:, 7:]), np.abs(poses[:, 7:]), atol=1e-15)
        steps = [np.linalg.norm(np.diff(p[:, :2], axis=0), axis=1) for p in (placed, poses)]
        np.testing.assert_allclose(*steps, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"closed": [True] * 4}, "clip cut: a|clip cut is closed: its angles must go once round"),
        ({"closed": CLOSED[:3]}, "4 clips, 3 closed"),
        ({"names": ("a", "a", "b", "c")}, "a name of its own"),
        ({"angles": [*ANGLES[:3], ANGLES[3][:-1]]}, r"clip cut has 140 frames, its angles have shape \(139,\)"),
        ({"angles": [*ANGLES[:3], ANGLES[3][::-1]]}, "must be finite and increase"),
        ({"angles": [*ANGLES[:3], angles_once_round(140, 0.3, TURN)]}, "leave a gap of 0.05 rad or more"),
        ({"angles": [*ANGLES[:3], np.append(ANGLES[3][:-1] / 3.0, 5.0)]}, "clip cut: two of its frames are 3.12 rad"),
        ({"sites": ring(4)[:4]}, r"sites must have shape \(rows ≥ 8, 4 clips, 2: r and z\), got \(4, 4, 2\)"),
        ({"sites": ring(4) * np.nan}, "sites must be finite"),
        ({"sites": ring(4, centre=(0.012, 0.0))}, "from the axis, where the phase is not defined"),
        ({"sites": ring(4)[:, [0, 1, 2, 2]]}, "the curves of clips turn and cut come to 0.000 mm of each other"),
        ({"margin": 0.0}, "margin of a lifted map"),
    ],
)
def test_invalid_arguments_raise_parameter_error(change, message):
    arguments = {
        "clips": LIFTED_CLIPS, "closed": CLOSED, "angles": ANGLES, "sites": ring(4), "limbs": [LEG],
        "names": ("walk", "still", "turn", "cut"),
    }  # fmt: skip
    with pytest.raises(ParameterError, match=message):
        Lifted(**(arguments | change))


def test_closed_clip_with_a_gap_raises_parameter_error():
    poses = LIFTED_CLIPS[3][0]
    assert closing_gap(poses) > 0.1
    with pytest.raises(ParameterError, match=r"clip 0 is to be closed, but its last frame is 0\.\d+ from its first"):
        Lifted([(poses, 30.0)], [True], [angles_once_round(140)], ring(1))


"""The joints of the map without limbs that are left to all clips."""


@pytest.mark.parametrize("share", [1.0, 0.4, 0.0])
def test_legs_are_of_one_clip_and_arms_have_their_share_of_the_others(share):
    owner, rng = 1, np.random.default_rng(5)
    owned = WITHOUT_LIMBS.with_legs_of(owner, ARM_JOINTS, share)
    for r, angle, z in rng.uniform([0.03, 0.1, -0.02], [0.07, 6.2, 0.02], (60, 3)):
        x, own = stylus(r, angle, z), WITHOUT_LIMBS.site(owner, np.array(angle))
        alone = WITHOUT_LIMBS.pose(stylus(own[0], angle, own[1]))
        pose = owned.pose(x)
        np.testing.assert_allclose(difference(pose, alone)[:9], 0.0, atol=1e-9)
        # The chordal mean of clips is the dominant eigenvector of their weighted sum of q qᵀ (Markley et al. 2007).
        weights, moments = (share * WITHOUT_LIMBS.weights(x) + (1.0 - share) * np.eye(4)[owner], np.zeros((2, 4, 4)))
        for i, weight in enumerate(weights):
            at = WITHOUT_LIMBS.site(i, np.array(angle))
            clip = WITHOUT_LIMBS.pose(stylus(at[0], angle, at[1]))[11:].reshape(2, 4)
            moments += weight * clip[:, :, None] * clip[:, None, :]
        mean = np.linalg.eigh(moments)[1][:, :, -1].ravel()
        np.testing.assert_allclose(difference(pose, np.concatenate([pose[:11], mean]))[9:], 0.0, atol=1e-6)


def test_with_legs_of_leaves_the_original_map_unchanged():
    before, x = WITHOUT_LIMBS.pose(stylus(0.05, 2.0, 0.004)), stylus(0.05, 2.0, 0.004)
    owned = WITHOUT_LIMBS.with_legs_of(2, ARM_JOINTS, 0.5)
    assert np.abs(difference(owned.pose(x), before)).max() > 0.01
    np.testing.assert_array_equal(WITHOUT_LIMBS.pose(x), before)
    assert (WITHOUT_LIMBS.remarks, WITHOUT_LIMBS.legs_of) == ((), None)
    assert owned.remarks == (
        "legs and trunk are those of turn wherever the hand is pushed, with 50 % of the others' arm motion",
    )


@pytest.mark.parametrize(
    ("clip", "upper", "share"), [(4, ARM_JOINTS, 1.0), (0, [4], 1.0), (0, [0], 1.0), (0, ARM_JOINTS, 1.5)]
)
def test_invalid_legs_raise_parameter_error(clip, upper, share):
    with pytest.raises(ParameterError, match="a lifted map takes the legs of clip 0 to 3"):
        WITHOUT_LIMBS.with_legs_of(clip, upper, share)


def test_joints_of_a_limb_cannot_be_left_to_other_clips():
    with pytest.raises(ParameterError, match="no limb's"):
        LIFTED.with_legs_of(0, [2], 1.0)
