"""Small synthetic clips for tests of haptic maps: a root and three joints, smooth and exactly cyclic."""

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.haptic_map.map_stages import evaluate_map, evaluate_map_jacobian
from controllers.legs.limbs import Limb
from sim.compilation.kernel_units import linked_stages
from tests.derivatives import extrapolated_differences

JOINTS = 3
# The three joints as a leg: hip, knee (flexion about y), ankle.
LEG = Limb(
    (1, 2, 3),
    np.array([[0.0, 0.1, 0.0], [0.0, 0.0, -0.45], [0.0, 0.0, -0.45]]),
    np.array([0.0, 1.0, 0.0]),
    np.array([[-0.05, 0.0, -0.05], [0.15, 0.03, -0.05], [0.15, -0.03, -0.05]]),
)


def wxyz(rotation):
    return np.roll(rotation.as_quat(), 1, axis=-1)


def matrices(quaternions):
    return Rotation.from_quat(np.roll(quaternions, -1, axis=-1)).as_matrix()


def swinging(seed, frames=120, travel=0.0, turns=0.0, amplitude=0.5, phase=0.0):
    """Poses (frames + 1, 19) of a root that sways, travels along x and turns about z, and of joints that swing."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, frames + 1)
    lap = 2.0 * np.pi * (s + phase)
    poses = np.empty((frames + 1, 7 + 4 * JOINTS))
    poses[:, 0] = travel * s + 0.02 * np.sin(lap)
    poses[:, 1] = 0.01 * np.cos(lap)
    poses[:, 2] = 0.95 + 0.02 * np.cos(2.0 * lap)
    for joint in range(JOINTS + 1):
        size, lead = rng.normal(size=3) * amplitude * (0.3 if joint == 0 else 1.0), rng.uniform(0.0, 6.0, 3)
        rotation = Rotation.from_rotvec(size * np.sin(lap[:, None] + lead))
        if joint == 0:
            rotation = Rotation.from_rotvec(np.outer(2.0 * np.pi * turns * s, [0.0, 0.0, 1.0])) * rotation
        poses[:, 3 + 4 * joint : 7 + 4 * joint] = wxyz(rotation)
    return poses


def difference(end, start):
    """Tangents between poses (..., nq): root position, then local rotation vectors, shape (..., nv)."""
    a, b = (Rotation.from_quat(np.reshape(q[..., 3:], (-1, 4)), scalar_first=True) for q in (start, end))
    turns = (a.inv() * b).as_rotvec().reshape(*np.shape(start)[:-1], -1)
    return np.concatenate([end[..., :3] - start[..., :3], turns], axis=-1)


def stylus(r, angle, z):
    """Stylus pose at cylindrical coordinates, upright."""
    return np.array([r * np.cos(angle), r * np.sin(angle), z, 1.0, 0.0, 0.0, 0.0])


def walker(s, held=0.0):
    """Argument of the map of a led figure at arc length s [m]; `held` is 1 for the grounded form of its gait."""
    return np.array([s, held, 0.0, 1.0, 0.0, 0.0, 0.0])


def displaced(x, tangent):
    """A stylus pose moved by tangent[:3] [m] and turned by the rotation vector tangent[3:] in the hand frame H."""
    turn = Rotation.from_rotvec(tangent[3:]) * Rotation.from_quat(np.roll(x[3:], -1))
    return np.concatenate([x[:3] + tangent[:3], wxyz(turn)])


def numeric_jacobian(h_map, x, step, memory=None):
    """Derivative (nv, 3) of a map's pose by the stylus position, by extrapolated differences with a step [m]."""

    def pose_at(p):
        y = np.concatenate([p, x[3:]])
        return h_map.pose(y) if memory is None else h_map.pose(y, memory.copy())

    return extrapolated_differences(pose_at, x[:3], step, difference)


def assert_same_compiled(h_map, x):
    """Assert that the compiled stages of a map give its pose and Jacobian at a stylus pose to the last bit."""
    (stages, params, memory, _), pose, other = h_map.compiled(), *np.empty((2, h_map.nq))
    stages, jacobian = linked_stages(stages), np.empty((h_map.nv, 6))
    evaluate_map(stages, params, x, memory, pose)
    evaluate_map_jacobian(stages, params, x, memory, other, jacobian)
    np.testing.assert_array_equal(pose, h_map.pose(x))
    np.testing.assert_array_equal(other, pose)
    np.testing.assert_array_equal(jacobian, h_map.jacobian(x))
