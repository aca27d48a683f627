"""The cylindrical map: its corners, its smoothness and its seam."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.curves.cylinder import eased_weight
from controllers.errors import ParameterError
from controllers.haptic_map.cylindrical import Cylindrical, LegsOfOneClip
from controllers.motion.lap import LAP_HEADING, LAP_X, LAPS
from tests.controllers.clips_for_maps import LEG, difference, matrices, numeric_jacobian, stylus, swinging
from tests.controllers.example_maps import CLIPS, CORNERS, CYLINDRICAL, CYLINDRICAL_ARMS, R, Z
from tests.derivatives import central_differences

STILL = Cylindrical(CLIPS, R, Z)


def test_corner_plays_its_clip():
    # The first clip keeps its own phase, so frame k is at k laps / frames; the others are shifted in phase.
    for k in range(0, 120, 7):
        pose = STILL.pose(stylus(*_at(0, k / 120)))
        np.testing.assert_allclose(
            matrices(pose[7:].reshape(-1, 4)), matrices(CLIPS[0][0][k, 7:].reshape(-1, 4)), atol=1e-9
        )
        assert pose[2] == pytest.approx(CLIPS[0][0][k, 2], abs=1e-7)


def _at(corner, s):
    r, z = CORNERS[corner]
    return r, 2.0 * np.pi * s, z


def test_maps_of_the_same_clips_are_equal_and_share_no_numbers():
    def made(legs_of=1, lap=2.0, clips=CLIPS):
        return Cylindrical(clips, R, Z, [LEG], lap=lap, legs=LegsOfOneClip(legs_of, (3,)))

    first, x = made(), stylus(0.05, 2.0, 0.004)
    pose = first.pose(x)
    first._params[:] = np.nan
    first.loops.clear()
    np.testing.assert_array_equal(made().pose(x), pose)
    faster = [CLIPS[0], (CLIPS[1][0], 31.0), *CLIPS[2:]]
    moved = [(CLIPS[0][0] + 1e-9 * (np.arange(CLIPS[0][0].shape[1]) == 2), 30.0), *CLIPS[1:]]
    assert made(clips=faster).lap_durations[1] < made().lap_durations[1]
    for other in (made(lap=9.0), made(clips=moved), made(legs_of=2)):
        assert not np.array_equal(other._params, made()._params)


def test_blend_of_a_clip_with_itself_is_the_clip_everywhere():
    same = Cylindrical([CLIPS[0]] * 4, R, Z)
    for r, z in ((0.03, -0.03), (0.05, 0.0), (0.06, 0.02), (0.2, 0.5), (0.001, -0.5)):
        for s in (0.1, 0.45, 0.8):
            pose, corner = (same.pose(stylus(*at)) for at in ((r, 2 * np.pi * s, z), _at(0, s)))
            np.testing.assert_allclose(difference(pose, corner), 0.0, atol=1e-12)


@pytest.mark.parametrize("owner", range(4))
def test_root_and_legs_of_one_clip_do_not_depend_on_the_corner(owner):
    arms = Cylindrical(CLIPS, R, Z, legs=LegsOfOneClip(owner, (3,), "jog"))
    for corner in range(4):
        for s in (0.1, 0.45, 0.8):
            pose = arms.pose(stylus(*_at(corner, s)))
            own, others = (STILL.pose(stylus(*_at(k, s))) for k in (owner, corner))
            np.testing.assert_allclose(difference(pose, own)[:12], 0.0, atol=1e-9)
            np.testing.assert_allclose(difference(pose, others)[12:], 0.0, atol=1e-9)
    assert arms.remarks[0].endswith("legs and trunk are those of jog")
    assert arms.with_share(0.5).remarks[0].split(", with")[0].endswith("of jog")


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_share_of_other_joints_scales_their_rotation(share):
    arms = Cylindrical(CLIPS, R, Z, legs=LegsOfOneClip(1, (3,)))
    some = arms.with_share(share)
    for corner in range(4):
        for s in (0.1, 0.45, 0.8):
            x = stylus(*_at(corner, s))
            part, whole = (
                difference(some.pose(x), arms.with_share(0.0).pose(x)),
                difference(arms.pose(x), arms.with_share(0.0).pose(x)),
            )
            np.testing.assert_allclose(part[:12], 0.0, atol=1e-12)
            # The chordal mean of two rotations lies between them; its angle is near the share of theirs.
            np.testing.assert_allclose(np.cross(part[12:], whole[12:]), 0.0, atol=1e-9)
            assert np.linalg.norm(part[12:]) == pytest.approx(share * np.linalg.norm(whole[12:]), rel=0.15)
    assert (f"{100 * share:.0f} % of the others' arm motion" in some.remarks[0]) == (share < 1.0)
    assert ("plays alone" in some.remarks[0]) == (share == 0.0)


def test_lap_at_own_pace_is_that_of_the_legs_and_others_count_only_if_they_are_blended_in():
    clips = [(poses, fps / (1 + k)) for k, (poses, fps) in enumerate(CLIPS)]
    whole, arms = Cylindrical(clips, R, Z), Cylindrical(clips, R, Z, legs=LegsOfOneClip(2, (3,)))
    durations = [loop.duration for loop in whole.loops]
    assert len(set(durations)) == len(durations)
    assert whole.lap_seconds == pytest.approx(np.mean(durations))
    assert arms.lap_seconds == durations[2]
    np.testing.assert_allclose(arms.lap_durations, durations)
    np.testing.assert_allclose(arms.with_share(0.0).lap_durations, durations[2:3])


@pytest.mark.parametrize("haptic_map", [STILL, CYLINDRICAL_ARMS], ids=["all joints", "arms only"])
def test_share_out_of_range_or_without_legs_of_one_clip_raises_parameter_error(haptic_map):
    with pytest.raises(ParameterError, match="share of other joints from 0 to 1"):
        haptic_map.with_share(1.1 if haptic_map.legs else 0.5)


@pytest.mark.parametrize("legs", [None, LegsOfOneClip(0, (3,))], ids=["all joints", "arms only"])
def test_joint_whose_rotations_pass_half_a_turn_does_not_flip(legs):
    clips = []
    for sign in (1.0, -1.0):
        poses = swinging(1, 120)
        angle = sign * np.deg2rad(80.0 + 40.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 121)))
        poses[:, 3 + 4 * 3 :] = 0.0
        poses[:, 3 + 4 * 3], poses[:, 3 + 4 * 3 + 1] = np.cos(0.5 * angle), np.sin(0.5 * angle)
        clips.append((poses, 30.0))
    haptic_map, places = Cylindrical([*clips, *clips], R, Z, legs=legs), np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    for r in (0.5 * sum(R), 0.5 * sum(R) + 1e-4):
        joint = matrices(np.array([haptic_map.pose(stylus(r, angle, 0.0))[-4:] for angle in places]))
        steps = np.arccos(np.clip(0.5 * (np.einsum("nij,nij->n", joint, np.roll(joint, 1, axis=0)) - 1.0), -1.0, 1.0))
        assert steps.max() < np.deg2rad(2.0)
    pose = stylus(0.5 * sum(R) + 2e-3, 1.0, 0.0)
    np.testing.assert_allclose(haptic_map.jacobian(pose)[:, :3], numeric_jacobian(haptic_map, pose, 1e-5), atol=1e-4)
    for corner in range(2):
        pose = haptic_map.pose(stylus(*_at(corner, 0.25)))
        assert abs(pose[-4:] @ haptic_map.loops[corner].channels(np.array([0.25]), np.zeros(1))[0, -4:]) > 0.99


def test_pose_beyond_the_edges_equals_that_at_the_edge():
    for k, (r, z) in enumerate([(0.005, -0.2), (0.3, -0.1), (0.02, 0.2), (0.2, 0.31)]):
        np.testing.assert_array_equal(STILL.pose(stylus(r, 1.0, z)), STILL.pose(stylus(*_at(k, 1.0 / (2 * np.pi)))))


def test_blend_weight_eases_at_the_ends_and_is_linear_between():
    assert eased_weight(-1.0) == (0.0, 0.0)
    assert eased_weight(2.0) == (1.0, 0.0)
    assert eased_weight(0.5)[0] == pytest.approx(0.5)
    s = np.linspace(-0.2, 1.2, 1401)
    weight, slope = np.array([eased_weight(v) for v in s]).T
    assert (np.diff(weight) >= 0.0).all()
    numeric = [central_differences(lambda v: eased_weight(v)[0], v, 1e-6) for v in s]
    np.testing.assert_allclose(slope, numeric, atol=1e-5)
    # C²: the slope has no kink either.
    assert np.abs(np.diff(slope, 2)).max() < 1e-3
    np.testing.assert_allclose(np.diff(weight[(s > 0.2) & (s < 0.8)], 2), 0.0, atol=1e-15)


def test_pose_does_not_depend_on_the_stylus_orientation():
    x = stylus(0.05, 1.0, 0.01)
    turned = x.copy()
    turned[3:] = [0.5, 0.5, -0.5, 0.5]
    np.testing.assert_array_equal(STILL.pose(x), STILL.pose(turned))


@pytest.mark.parametrize("position", [(0.03, -0.03), (0.05, 0.0), (0.06, 0.02), (0.03, 0.03)])
def test_pose_velocity_and_acceleration_are_continuous_over_the_seam(position):
    memory, step, poses = CYLINDRICAL.compiled().memory, 2e-3, []
    for k in range(-40, 41):
        # The seam lies between two samples, as at a servo's ticks.
        poses.append(CYLINDRICAL.pose(stylus(position[0], (k + 0.4) * step, position[1]), memory))
    velocity = np.array([difference(b, a) for a, b in pairwise(poses)]) / step
    change = np.abs(np.diff(velocity, axis=0)).max(axis=1)
    assert memory[LAPS] == 1.0
    # Over the seam the velocity changes as little as beside it.
    assert change[38:42].max() < 2.0 * np.delete(change, range(38, 42)).max()
    assert change.max() < 0.2


def test_lap_there_and_back_returns_to_the_same_pose():
    memory = CYLINDRICAL.compiled().memory
    path = np.concatenate([np.linspace(0.1, 15.0, 400), np.linspace(15.0, 0.1, 400)])
    poses = [CYLINDRICAL.pose(stylus(0.045, angle, 0.012), memory) for angle in path]
    assert np.linalg.norm(np.subtract(poses[399], poses[0])[:2]) > 0.05
    moved = difference(poses[-1], poses[0])
    np.testing.assert_allclose(moved[2:], 0.0, atol=1e-8)  # places of held feet are sums of steps
    np.testing.assert_allclose(moved[:2], 0.0, atol=1e-5)  # the root follows its feet: 3.7 µm in three laps
    assert memory[LAPS] == 0.0


def test_memory_has_no_effect_for_clips_without_drift():
    memory = STILL.compiled().memory
    for angle in np.linspace(0.1, 40.0, 500):
        x = stylus(0.05, angle, 0.0)
        np.testing.assert_array_equal(STILL.pose(x, memory), STILL.pose(x))
    assert memory[LAP_X] == memory[LAP_HEADING] == 0.0


def test_walk_advances_by_its_stride_each_lap():
    memory = CYLINDRICAL.compiled().memory
    start = CYLINDRICAL.pose(stylus(*_at(0, 0.3)), memory)
    for s in np.linspace(0.3, 3.3, 200):
        end = CYLINDRICAL.pose(stylus(*_at(0, s)), memory)
    assert np.linalg.norm(end[:2] - start[:2]) == pytest.approx(3 * 1.3, abs=1e-6)
    np.testing.assert_allclose(difference(end, start)[2:], 0.0, atol=1e-9)


@settings(max_examples=60)
@given(st.tuples(*[st.floats(-10.0, 10.0)] * 3))
def test_pose_is_finite_with_unit_quaternions_everywhere(p):
    x = np.array([*p, 1.0, 0.0, 0.0, 0.0])
    for h_map in (STILL, CYLINDRICAL):
        pose = h_map.pose(x)
        assert np.isfinite(h_map.jacobian(x)).all()
        np.testing.assert_allclose(np.linalg.norm(pose[3:].reshape(-1, 4), axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((CLIPS[:3], R, Z), "blends 4 clips, got 3"),
        ((CLIPS, (0.07, 0.03), Z), "r_range must increase"),
        ((CLIPS, (0.0, 0.03), Z), "from 1 mm or more, got "),
        ((CLIPS, R, (0.0, np.nan)), "z_range must increase"),
        ((CLIPS, R, Z, (), None, None, LegsOfOneClip(4, (3,))), "legs are of clip 0 to 3, got 4"),
        (([*CLIPS[:3], (CLIPS[3][0][:, :11], 30.0)], R, Z), r"same size, got \[19, 19, 19, 11\]"),
    ],
)
def test_invalid_arguments_raise_parameter_error(arguments, message):
    with pytest.raises(ParameterError, match=message):
        Cylindrical(*arguments)
