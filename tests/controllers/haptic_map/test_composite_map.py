"""The composite map: which clip each joint comes from."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from tests.controllers.clips_for_maps import LEG, difference, stylus
from tests.controllers.example_maps import BLUE, COMPOSITE, LOWER, RED, R

# Each clip alone, with the same alignment, at the corners of a cylinder.
SINGLE_CLIPS = Cylindrical([LOWER, RED, BLUE, LOWER], R, (-0.01, 0.01))
IN_LOWER, IN_RED, IN_BLUE = (R[0], -0.01), (R[1], -0.01), (R[0], 0.01)


def single_clip_pose(corner, angle):
    return SINGLE_CLIPS.pose(stylus(corner[0], angle, corner[1]))


@pytest.mark.parametrize("angle", [0.3, 2.1, 5.9])
def test_lower_body_is_of_one_clip_and_upper_body_blends_the_others(angle):
    for r, upper in ((0.01, IN_RED), (R[0], IN_RED), (R[1], IN_BLUE), (0.1, IN_BLUE)):
        pose = COMPOSITE.pose(stylus(r, angle, 0.05))
        np.testing.assert_allclose(difference(pose, single_clip_pose(IN_LOWER, angle))[:12], 0.0, atol=1e-9)
        np.testing.assert_allclose(difference(pose, single_clip_pose(upper, angle))[12:], 0.0, atol=1e-9)
    middle = COMPOSITE.pose(stylus(0.05, angle, 0.0))
    to_red, to_blue = (
        np.linalg.norm(difference(middle, single_clip_pose(end, angle))[12:]) for end in (IN_RED, IN_BLUE)
    )
    assert to_red == pytest.approx(to_blue, rel=1e-6)
    assert to_red > 0.05


@pytest.mark.parametrize("angle", [0.3, 2.1, 5.9])
def test_share_of_other_arms_scales_their_difference(angle):
    none, some = COMPOSITE.with_share(0.0), COMPOSITE.with_share(0.25)
    lower, red = single_clip_pose(IN_LOWER, angle), single_clip_pose(IN_RED, angle)
    np.testing.assert_allclose(difference(none.pose(stylus(0.05, angle, 0.0)), lower), 0.0, atol=1e-9)
    part = difference(some.pose(stylus(R[0], angle, 0.0)), lower)[12:]
    assert np.linalg.norm(part) == pytest.approx(0.25 * np.linalg.norm(difference(red, lower)[12:]), rel=0.15)
    assert (COMPOSITE.remarks, len(some.remarks)) == ((), 1)
    with pytest.raises(ParameterError, match="from 0 to 1"):
        COMPOSITE.with_share(-0.1)


@pytest.mark.parametrize(
    ("upper", "r_range", "limbs", "message"),
    [
        ((4,), R, (), "the poses have joints 1 to 3, a group needs 4"),
        ((0,), R, (), "the poses have joints 1 to 3, a group needs 0"),
        ((3,), R, (LEG,), r"a limb of joints \(1, 2, 3\) shares some"),
        ((3,), (0.0, 0.05), (), "r_range must increase from 1 mm or more"),
    ],
)
def test_invalid_arguments_raise_parameter_error(upper, r_range, limbs, message):
    with pytest.raises(ParameterError, match=message):
        Composite(LOWER, RED, BLUE, upper, r_range, limbs)
