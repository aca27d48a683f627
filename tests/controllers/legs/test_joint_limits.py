"""Joint limits of limbs in the air: saturation beyond them, no change within them, exact derivatives."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_limbs import foot

from controllers.errors import ParameterError
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.legs.joint_limits import SATURATION_WIDTH, height_weight, saturate_joint
from tests.controllers.clips_for_maps import LEG, numeric_jacobian, stylus, swinging
from tests.derivatives import central_differences

R, Z = (0.03, 0.07), (-0.03, 0.03)
CLIPS = [(swinging(seed, amplitude=0.3) + 0.2 * (np.arange(19) == 2), 30.0) for seed in (1, 2, 3, 5)]
LIMITS = np.array([[-0.3, 0.4], [-0.2, 1.8], [-0.5, 0.5]])


AIR, GROUND = 1.0, 0.05


def held(vector, rates=None, height=(AIR, 0.0, 0.0)):
    """Rotation of a joint after its limits are applied, and its angular velocities."""
    q = Rotation.from_rotvec(vector).as_quat(scalar_first=True)
    rates = np.zeros((3, 0)) if rates is None else rates.copy()
    saturate_joint(LIMITS, np.array(height), q, rates, rates.shape[1])
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)
    return Rotation.from_quat(q, scalar_first=True), rates


def test_joint_within_limits_or_near_the_ground_is_unchanged():
    rng = np.random.default_rng(0)
    cases = [(vector, AIR) for vector in rng.uniform(LIMITS[:, 0], LIMITS[:, 1], (50, 3))]
    cases += [(vector, GROUND) for vector in rng.uniform(-1.7, 1.7, (50, 3))]
    for vector, height in cases:
        q = -Rotation.from_rotvec(vector).as_quat(scalar_first=True)
        rates = rng.normal(size=(3, 3))
        after, changed = q.copy(), rates.copy()
        saturate_joint(LIMITS, np.array([height, 1.0, 1.0, 1.0]), after, changed, 3)
        np.testing.assert_array_equal(after, q)
        np.testing.assert_array_equal(changed, rates)


def test_joint_beyond_limits_saturates():
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(300, 3))
    vectors *= rng.uniform(0.5, 2.85, (300, 1)) / np.linalg.norm(vectors, axis=1, keepdims=True)
    for vector in vectors:
        low, high = LIMITS.T
        after = held(vector)[0].as_rotvec()
        assert (after > low - 0.5 * SATURATION_WIDTH - 1e-9).all()
        assert (after < high + 0.5 * SATURATION_WIDTH + 1e-9).all()
        far = (vector < low - SATURATION_WIDTH) | (vector > high + SATURATION_WIDTH)
        beyond = np.where(vector > high, high + 0.5 * SATURATION_WIDTH, low - 0.5 * SATURATION_WIDTH)
        np.testing.assert_allclose(after[far], beyond[far], atol=1e-9)


@pytest.mark.parametrize("height", [0.2, 0.31, AIR])
@pytest.mark.parametrize("size", [1.0, 2.0, 2.95, 3.05])
def test_angular_velocity_matches_finite_differences(size, height):
    rng = np.random.default_rng(2)
    for _ in range(50):
        vector = rng.normal(size=3)
        start = Rotation.from_rotvec(vector * size / np.linalg.norm(vector))
        rates = rng.normal(size=(3, 2))
        rise = rng.normal(size=2)
        changed = held(start.as_rotvec(), rates, (height, *rise))[1]
        for k in range(2):

            def held_at(h, start=start, rate=rates[:, k], rise=rise[k]):
                return held((start * Rotation.from_rotvec(h * rate)).as_rotvec(), None, [height + h * rise])[0]

            expected = central_differences(held_at, 0.0, 1e-5, lambda end, start: (start.inv() * end).as_rotvec())
            np.testing.assert_allclose(changed[:, k], expected, atol=1e-6 * (1.0 + np.abs(expected).max()))


def test_joint_turning_over_does_not_jump():
    axis = np.array([0.6, -0.64, 0.48])
    for step in (1e-3, 1e-4):
        turns = [held(angle * axis)[0] for angle in np.arange(2.8, 3.6, step)]
        jumps = [(a.inv() * b).magnitude() for a, b in pairwise(turns)]
        assert max(jumps) < 40.0 * step


def test_blend_keeps_the_limits_of_its_clips_with_an_exact_jacobian():
    free = Cylindrical(CLIPS, R, Z, [LEG])
    narrow = Cylindrical(CLIPS, R, Z, [replace(LEG, limits=np.zeros((3, 3, 2)))])
    (leg,) = narrow.limbs
    rng, changes, worst = np.random.default_rng(3), 0, 0.0
    for _ in range(150):
        x = stylus(rng.uniform(0.03, 0.07), rng.uniform(0.01, 6.27), rng.uniform(-0.03, 0.03))
        pose = narrow.pose(x)
        vectors = Rotation.from_quat(pose[7:19].reshape(3, 4), scalar_first=True).as_rotvec()
        within = (vectors > leg.limits[..., 0] - 0.5 * SATURATION_WIDTH - 1e-9) & (
            vectors < leg.limits[..., 1] + 0.5 * SATURATION_WIDTH + 1e-9
        )
        assert within.all() or height_weight(foot(free.pose(x))[0][2])[0] < 1.0
        changes += not np.array_equal(pose, free.pose(x))
        jacobian = narrow.jacobian(x)
        error = np.abs(numeric_jacobian(narrow, x, 4e-6) - jacobian[:, :3]).max()
        worst = max(worst, error / (1.0 + np.abs(jacobian).max()))
    assert changes > 10
    assert worst < 1e-6
    # At a single clip no limit is applied.
    for angle in np.linspace(0.1, 6.0, 40):
        x = stylus(R[0], angle, Z[0])
        np.testing.assert_array_equal(narrow.pose(x), free.pose(x))


def test_non_increasing_limits_raise_parameter_error():
    with pytest.raises(ParameterError, match="limits of a limb's joints must increase"):
        replace(LEG, limits=np.tile([0.1, -0.1], (3, 3, 1)))
