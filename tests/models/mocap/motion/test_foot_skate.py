"""Slide from where a contact began, and skate about the median place of a stance."""

import numpy as np
import pytest

from models.mocap.motion.foot_skate import ContactSlide, stance_skates


def test_skate_is_the_largest_distance_from_the_median_place():
    points = np.zeros((10, 2, 3))
    points[:4, 0, 0] = 0.0, 0.0, 0.0, 0.03
    points[6:, 0, 1] = 0.1, 0.1, 0.1, 0.14
    points[:, 1, 2] = 0.01 * np.arange(10)
    standing = np.ones((10, 2), dtype=bool)
    standing[4:6, 0] = False
    np.testing.assert_allclose(stance_skates(points, standing), [0.03, 0.04, 0.0])
    np.testing.assert_allclose(stance_skates(points, ~np.ones((10, 2), dtype=bool)), [0.0])


@pytest.mark.parametrize("blocks", [(10,), (3, 3, 4), (1,) * 10])
def test_slide_is_the_largest_distance_from_where_the_contact_began(blocks):
    points, touching = np.zeros((10, 2, 3)), np.ones((10, 2), dtype=bool)
    points[:, 0, 0] = 0.01 * np.arange(10)
    points[:, 1, 2] = 0.01 * np.arange(10)  # only the distance over the floor counts
    touching[5, 0] = False
    slide, first = ContactSlide(), 0
    for n in blocks:
        slide.add(points[first : first + n], touching[first : first + n])
        first += n
    assert slide.largest == pytest.approx(0.04)
    assert stance_skates(points, touching).max() == pytest.approx(0.02)
