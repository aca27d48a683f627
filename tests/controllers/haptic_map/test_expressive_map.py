"""The expressive map: the base at an upright stylus, its Jacobian, joint limits, and C² edges."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.expressive import Expressive, ExpressiveJoint, saturate_at_limit, stylus_turn
from tests.controllers.clips_for_maps import LEG, assert_same_compiled, difference, displaced, stylus, swinging, wxyz
from tests.derivatives import extrapolated_differences

CLIPS = [(swinging(seed, travel=0.4 * seed, turns=0.2), 30.0) for seed in range(4)]
BASE = Cylindrical(CLIPS, (0.03, 0.07), (-0.02, 0.02))
# The clips exceed these ranges, so that the effect of the limits on the Jacobian is covered.
HEAD = ExpressiveJoint(3, (0.1, 0.6, -0.7), (-0.6, -0.4, -0.5), (0.5, 0.7, 0.6))
TRUNK = ExpressiveJoint(1, (0.5, 0.3, 0.2), (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
MAP = Expressive(BASE, (TRUNK, HEAD))


def turned(x, rotation):
    return np.concatenate([x[:3], wxyz(rotation)])


def random_stylus(rng, largest=np.pi):
    """A random stylus pose within the map's domain, turned by up to `largest` about a random axis."""
    axis = rng.normal(size=3)
    turn = Rotation.from_rotvec(rng.uniform(0.0, largest) * axis / np.linalg.norm(axis))
    return turned(stylus(rng.uniform(0.02, 0.08), rng.uniform(0.01, 6.27), rng.uniform(-0.03, 0.03)), turn)


def distance_to_limits(x):
    """The least distance [rad] of the expressive joints from their limits in the base map."""
    pose = BASE.pose(x)
    current = [(j, Rotation.from_quat(np.roll(pose[3 + 4 * j.joint :][:4], -1)).as_rotvec()) for j in (TRUNK, HEAD)]
    return min(min((joint.high - v).min(), (v - joint.low).min()) for joint, v in current)


def test_upright_stylus_gives_the_base_map_exactly():
    rng = np.random.default_rng(3)
    for _ in range(200):
        x = turned(random_stylus(rng), Rotation.identity())
        np.testing.assert_array_equal(MAP.pose(x), BASE.pose(x))
        np.testing.assert_array_equal(MAP.pose(-x * [-1, -1, -1, 1, 1, 1, 1]), BASE.pose(x))
        jacobian = MAP.jacobian(x)
        np.testing.assert_allclose(jacobian[:, :3], BASE.jacobian(x)[:, :3], atol=1e-14)


def test_small_rotation_turns_each_joint_by_its_gains_alone():
    x, small = stylus(0.05, 1.0, 0.0), np.array([2e-5, -3e-5, 1e-5])
    change = difference(MAP.pose(turned(x, Rotation.from_rotvec(small))), MAP.pose(x))
    free = Expressive(BASE, (ExpressiveJoint(2, (0.5, 0.3, 0.2), (-3.0,) * 3, (3.0,) * 3),))
    np.testing.assert_allclose(change[6:9], small * TRUNK.gain, atol=1e-12)
    np.testing.assert_allclose(np.delete(change, [6, 7, 8, 12, 13, 14]), 0.0, atol=1e-12)
    change = difference(free.pose(turned(x, Rotation.from_rotvec(small))), free.pose(x))
    np.testing.assert_allclose(change[9:12], small * [0.5, 0.3, 0.2], atol=1e-12)
    np.testing.assert_allclose(np.delete(change, [9, 10, 11]), 0.0, atol=1e-12)


@pytest.mark.slow
def test_jacobian_matches_finite_differences_on_the_manifold():
    lower_leg = Composite(
        *[(np.hstack([poses, swinging(9, len(poses) - 1)[:, 7:11]]), fps) for poses, fps in CLIPS[:3]],
        (4,), (0.03, 0.07), [LEG],
    )  # fmt: skip
    upper = Expressive(lower_leg, (ExpressiveJoint(4, HEAD.gain, HEAD.low, HEAD.high),))
    rng = np.random.default_rng(0)
    for h_map in (MAP, upper):
        errors, largest = [], 0.0
        for _ in range(200):
            x = random_stylus(rng)
            jacobian = h_map.jacobian(x)
            pose_at = lambda d, h_map=h_map, x=x: h_map.pose(displaced(x, d))  # noqa: E731
            numeric = extrapolated_differences(pose_at, np.zeros(6), 1e-5, difference)
            errors.append(np.abs(numeric - jacobian).max() / (1.0 + np.abs(jacobian).max()))
            largest = max(largest, np.abs(jacobian[:, 3:]).max())
        assert max(errors) < 1e-6
        assert largest > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_pose_is_twice_differentiable_over_every_edge(seed):
    """Along rotations by 0 to 360° about an axis: beyond the joint limits, through half a turn and back."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    x = next(x for x in (random_stylus(rng) for _ in range(1000)) if distance_to_limits(x) > 0.2)

    def roughness(steps):
        angles = np.linspace(0.0, 2.0 * np.pi, steps + 1)
        lines = [turned(x, Rotation.from_rotvec(angle * axis)) for angle in angles]
        poses, slopes = [MAP.pose(y) for y in lines], np.array([MAP.jacobian(y)[:, 3:] @ axis for y in lines])
        jumps = [np.abs(difference(end, start)).max() for start, end in itertools.pairwise(poses)]
        return max(jumps), np.abs(np.diff(slopes, axis=0)).max(), np.abs(np.diff(slopes, 2, axis=0)).max()

    coarse, fine = roughness(750), roughness(3000)
    assert coarse[0] > 1e-3
    # Without jump or kink of the Jacobian its second difference goes with the square of the step.
    assert fine[0] < 0.3 * coarse[0]
    assert fine[1] < 0.3 * coarse[1]
    assert fine[2] < 0.12 * coarse[2]


def test_joint_yields_smoothly_to_its_limit_and_never_exceeds_it():
    current, low, high = 0.2, -0.5, 0.9
    requested = np.linspace(-30.0, 30.0, 6001)
    applied = np.array([saturate_at_limit(y, current, low, high)[0] for y in requested])
    assert (np.diff(applied) >= 0.0).all()
    assert low < current + applied.min() < low + 0.03
    assert high - 0.03 < current + applied.max() < high
    np.testing.assert_allclose(applied[np.abs(requested) < 0.2], requested[np.abs(requested) < 0.2], rtol=0.02)
    # Where the clip exceeds the limit already, it is neither turned further nor back.
    assert 0.0 <= saturate_at_limit(1.0, 1.1, low, high)[0] < 1e-3


def test_half_turn_either_way_gives_no_rotation():
    turn, rates = np.empty(3), np.empty((3, 3))
    for axis in np.random.default_rng(1).normal(size=(20, 3)):
        vector = np.pi * axis / np.linalg.norm(axis)
        for sign in (1.0, -1.0):
            stylus_turn(turned(np.zeros(3), Rotation.from_rotvec(sign * (1.0 - 1e-9) * vector)), turn, rates)
            np.testing.assert_allclose(turn, 0.0, atol=1e-15)
            np.testing.assert_allclose(rates, 0.0, atol=1e-12)


def test_compiled_map_is_identical():
    rng = np.random.default_rng(5)
    for _ in range(20):
        assert_same_compiled(MAP, random_stylus(rng))


def test_lap_memory_of_the_base_is_kept():
    memory, alone = MAP.compiled().memory, BASE.compiled().memory
    for angle in np.linspace(0.1, 13.0, 200):
        x = stylus(0.05, angle, 0.0)
        tilted = turned(x, Rotation.from_rotvec([0.3, 0.2, -0.4]))
        pose, jacobian_memory = MAP.pose(tilted, memory), memory.copy()
        MAP.jacobian(tilted, jacobian_memory)
        np.testing.assert_array_equal(pose[:7], BASE.pose(x, alone)[:7])
        np.testing.assert_array_equal(memory, alone)
        np.testing.assert_array_equal(jacobian_memory, memory)
    assert memory.any()


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ((), "at least one joint"),
        ((ExpressiveJoint(0, (1.0,) * 3, (-1.0,) * 3, (1.0,) * 3),), "joints 1 to 3, expression needs joint 0"),
        ((ExpressiveJoint(4, (1.0,) * 3, (-1.0,) * 3, (1.0,) * 3),), "joints 1 to 3, expression needs joint 4"),
        ((ExpressiveJoint(1, (1.0, np.nan, 1.0), (-1.0,) * 3, (1.0,) * 3),), "gains of joint 1 must be three finite"),
        ((ExpressiveJoint(1, (1.0,) * 3, (1.0,) * 3, (1.0,) * 3),), "range of joint 1 must be three intervals"),
    ],
)
def test_invalid_joints_raise_parameter_error(joints, message):
    with pytest.raises(ParameterError, match=message):
        Expressive(BASE, joints)


def test_expressive_map_of_an_expressive_map_raises_parameter_error():
    with pytest.raises(ParameterError, match="give all joints to one of them"):
        Expressive(MAP, (HEAD,))
