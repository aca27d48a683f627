"""Soft walls: the gradient of a potential of joint limits, and a brake that only dissipates."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.fields.algebra.map_feed import feed_maps, unlinked_maps
from controllers.fields.algebra.program import evaluate
from controllers.fields.soft_wall import SoftWall, _is_clear, wall_slope  # pyright: ignore[reportPrivateUsage]
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.state import HandState
from experiments.setups.maps.robot_arm import robot_arm_map
from models.robot_arm.spec import arm_limits, arm_model
from sim.compilation.kernel_units import linked_stages
from tests.derivatives import central_differences

FPS, K, MARGIN, DAMPING, SPEED = 30.0, 2.0, 0.1, 0.02, 6.0


def oscillating_clip(amplitude: float, bend: float):
    """A clip of a root and two joints: one oscillates about y once a lap, the other has an additional offset."""
    s = np.linspace(0.0, 1.0, 121)
    poses = np.zeros((121, 15))
    poses[:, 2] = 1.0
    poses[:, 3] = 1.0
    turns = np.stack([0.2 * np.sin(2 * np.pi * s), amplitude * np.cos(2 * np.pi * s), 0.1 * np.sin(4 * np.pi * s)], 1)
    poses[:, 7:11] = Rotation.from_rotvec(turns).as_quat(scalar_first=True)
    poses[:, 11:15] = Rotation.from_rotvec(turns + np.array([bend, 0.0, bend])).as_quat(scalar_first=True)
    poses[-1] = poses[0]
    return poses, FPS


MAP = Cylindrical(
    [oscillating_clip(0.3, 0.1), oscillating_clip(1.2, 0.2), oscillating_clip(0.3, 0.8), oscillating_clip(0.9, 1.2)],
    (0.03, 0.07),
    (-0.03, 0.03),
)
LIMITS = (np.array([[-0.5, 0.5]] * 3), np.array([[-0.6, 0.9], [-0.5, 0.7], [-0.4, 1.0]]))
WALL = SoftWall(MAP, (7, 11), (6, 9), LIMITS, K, MARGIN, 0.0)
BRAKE = SoftWall(MAP, (7, 11), (6, 9), LIMITS, 0.0, MARGIN, DAMPING, SPEED)
ARM = robot_arm_map(arm_model(), 1.5)
# Limits tighter than the motors', so that the arm reaches them within its domain.
TIGHT = tuple(arm_limits(arm_model())[:, None, :] * 0.4)
ARM_WALL = SoftWall(ARM, tuple(range(7)), tuple(range(7)), TIGHT, K, MARGIN, 0.0)


def position(r, angle, z):
    return np.array([r * np.cos(angle), r * np.sin(angle), z])


def stylus(p, q=(1.0, 0.0, 0.0, 0.0)):
    return np.concatenate([p, q])


def potential(haptic_map, wall, x):
    """The potential P∘h by its definition, with SciPy's rotation vectors."""
    q, total = haptic_map.pose(x), 0.0
    for column, limit in zip(wall.columns, wall.limits, strict=True):
        angles = q[column : column + 1]
        if len(limit) == 3:
            angles = Rotation.from_quat(q[column : column + 4], scalar_first=True).as_rotvec()
        for angle, (low, high) in zip(angles, limit, strict=True):
            for e in (angle - high + MARGIN, low + MARGIN - angle):
                if e > 0.0:
                    total += K * (
                        e**3 / 6.0 / MARGIN if e < MARGIN else 0.5 * e**2 - 0.5 * MARGIN * e + MARGIN**2 / 6.0
                    )
    return total


@pytest.mark.parametrize(("haptic_map", "wall"), [(MAP, WALL), (ARM, ARM_WALL)], ids=["ball joints", "hinges"])
def test_force_is_the_negative_gradient_of_the_limit_potential(haptic_map, wall):
    rng = np.random.default_rng(1)
    felt = 0
    for _ in range(200):
        p = position(rng.uniform(0.03, 0.07), rng.uniform(0.2, 6.0), rng.uniform(-0.03, 0.03))
        force = wall.wrench(HandState.at(p)).force
        gradient = central_differences(lambda p: potential(haptic_map, wall, stylus(p)), p, 1e-6)
        np.testing.assert_allclose(force, -gradient, rtol=1e-5, atol=1e-6)
        felt += np.linalg.norm(force) > 0.1
    assert felt > 50


def test_moment_is_the_negative_gradient_by_stylus_rotation():
    rng = np.random.default_rng(2)
    for _ in range(50):
        p, turn = rng.uniform(-0.05, 0.05, size=3), rng.uniform(-0.15, 0.15, size=3)
        q = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
        moment = ARM_WALL.wrench(HandState(0.0, p, q, np.zeros(3), np.zeros(3))).torque

        def turned(rotvec, p=p, turn=turn):
            rotation = Rotation.from_rotvec(rotvec) * Rotation.from_rotvec(turn)
            return potential(ARM, ARM_WALL, stylus(p, rotation.as_quat(scalar_first=True)))

        gradient = central_differences(turned, np.zeros(3), 1e-6)
        np.testing.assert_allclose(moment, -gradient, rtol=1e-5, atol=1e-6)


def test_no_work_along_closed_paths():
    """Gauss–Legendre quadrature of the work along the sides of random triangles."""
    rng = np.random.default_rng(3)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    for _ in range(5):
        corners = [
            position(rng.uniform(0.035, 0.065), rng.uniform(0.5, 1.5), rng.uniform(-0.025, 0.025)) for _ in range(3)
        ]
        total, absolute_work = 0.0, 0.0
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            forces = [WALL.wrench(HandState.at(a + 0.5 * (s + 1.0) * (b - a))).force for s in nodes]
            work = 0.5 * weights @ np.array(forces) @ (b - a)
            total, absolute_work = total + work, absolute_work + abs(work)
        assert abs(total) < 1e-6 * max(absolute_work, 1e-3)


def test_brake_dissipates_only_beyond_the_greatest_speed():
    rng = np.random.default_rng(4)
    braked = 0
    for _ in range(300):
        p = position(rng.uniform(0.02, 0.08), rng.uniform(0.0, 6.28), rng.uniform(-0.04, 0.04))
        v = rng.normal(scale=0.15, size=3)
        force = BRAKE.wrench(HandState.at(p, v)).force
        rates = MAP.push_forward(stylus(p), np.append(v, np.zeros(3)))
        speeds = np.linalg.norm(rates[6:].reshape(-1, 3), axis=1)
        dissipated = sum(DAMPING * max(0.0, speed - SPEED) * speed for speed in speeds)
        assert force @ v == pytest.approx(-dissipated, rel=1e-9, abs=1e-12)
        braked += dissipated > 0.0
    assert 30 < braked < 290


def test_pulled_back_wrench_has_the_power_of_the_torque():
    rng = np.random.default_rng(5)
    for _ in range(20):
        x, torque, twist = stylus(rng.uniform(-0.06, 0.06, size=3)), rng.normal(size=12), rng.normal(size=6)
        assert MAP.pull_back(x, torque) @ twist == pytest.approx(torque @ MAP.push_forward(x, twist), rel=1e-12)


def test_force_is_continuous_along_lines_through_the_wall():
    rng = np.random.default_rng(6)
    both = SoftWall(MAP, (7, 11), (6, 9), LIMITS, K, MARGIN, DAMPING, SPEED)
    for _ in range(10):
        a, b = (position(rng.uniform(0.02, 0.08), rng.uniform(0.5, 2.5), rng.uniform(-0.04, 0.04)) for _ in range(2))
        v = rng.normal(scale=0.2, size=3)
        for ends in (1e-3, 1e-6):
            s = np.linspace(0.4, 0.4 + ends, 300)
            forces = np.array([both.wrench(HandState.at(a + t * (b - a), v)).force for t in s])
            steps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
            # No step is much larger than the median step, so the force has a bounded slope.
            assert steps.max() <= 4.0 * np.median(steps) + 1e-12


def test_no_wrench_within_the_limits():
    wide = (np.array([[-3.0, 3.0]] * 3),) * 2
    wall = SoftWall(MAP, (7, 11), (6, 9), wide, K, MARGIN, DAMPING, 1e3)
    for angle in np.linspace(0.0, 6.0, 20):
        wrench = wall.wrench(HandState.at(position(0.05, angle, 0.0), (0.1, 0.0, 0.1)))
        assert not wrench.force.any()
        assert not wrench.torque.any()


def test_force_is_finite_far_away_and_on_the_axis():
    for p in ((0.0, 0.0, 0.0), (1e6, -1e6, 1e6), (1e-12, 0.0, 0.0), (0.0, 0.0, -1e9)):
        wrench = WALL.wrench(HandState.at(p, (1.0, 1.0, 1.0)))
        assert np.isfinite(wrench.force).all()


def test_compiled_sum_with_another_field_is_exact():
    program = WALL.program() + BRAKE.program()
    memory, wrench = program.fresh_memory(), np.empty(6)
    maps = unlinked_maps(program.feeds)
    maps = maps._replace(stages=linked_stages(maps.stages))
    for angle in np.linspace(0.0, 6.0, 30):
        hand = HandState.at(position(0.065, angle, 0.02), (0.2, -0.1, 0.05))
        feed_maps(maps, program.params, memory, hand.vector())
        evaluate(*program.compiled(), memory, hand.vector(), wrench)
        np.testing.assert_array_equal(wrench[:3], WALL.wrench(hand).force + BRAKE.wrench(hand).force)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stiffness": -1.0}, "stiffness must be"),
        ({"margin": 0.0}, "margin must be"),
        ({"speed": np.nan}, "speed must be"),
        ({"limits": (LIMITS[0],)}, "one each a joint"),
        ({"limits": (LIMITS[0], np.zeros((2, 2)))}, "expected"),
        ({"limits": (LIMITS[0], np.array([[0.0, 0.1]] * 3))}, "two margins"),
        ({"columns": (7, 13)}, "joint 1"),
        ({"rows": (6, 10)}, "joint 1"),
    ],
)
def test_out_of_range_arguments_raise_parameter_error(changes, message):
    arguments = {
        "haptic_map": MAP, "columns": (7, 11), "rows": (6, 9), "limits": LIMITS, "stiffness": K, "margin": MARGIN,
        "damping": DAMPING, "speed": SPEED,
    }  # fmt: skip
    with pytest.raises(ParameterError, match=message):
        SoftWall(**arguments | changes)


def test_joint_clear_of_walls_by_quaternion_is_clear_by_rotation_vector():
    rng, clear = np.random.default_rng(8), 0
    for _ in range(2000):
        low, high, margin = -rng.uniform(0.3, 3.0, 3), rng.uniform(0.3, 3.0, 3), rng.uniform(0.0, 0.3)
        turn = Rotation.from_rotvec(rng.normal(size=3) * rng.uniform(0.0, 1.0))
        quaternion, limits = turn.as_quat(scalar_first=True), np.stack([low, high], axis=1).ravel()
        if _is_clear.py_func(limits, 0, margin, quaternion[1:]):
            clear += 1
            angles = zip(turn.as_rotvec(), low, high, strict=True)
            assert not any(wall_slope.py_func(r, a, b, 10.0, margin) for r, a, b in angles)
    assert 200 < clear < 1800
