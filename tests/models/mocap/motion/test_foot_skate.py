"""Slide from where a contact began, and skate about the median place of a stance."""

import mujoco
import numpy as np
import pytest

from models.mocap.motion.foot_skate import ContactSlide, Rolling, stance_skates


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


SPHERE = """
<mujoco><option timestep="5e-4" impratio="10" cone="elliptic" density="0"/><worldbody>
<geom name="floor" type="plane" size="0 0 1" friction="{friction}"/>
<body pos="0 0 0.02"><freejoint/><geom type="sphere" size="0.02" mass="1" friction="{friction}"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(("friction", "slides"), [(1.0, 0.0), (1e-5, 0.5)])
def test_rolling_is_what_a_sphere_rolls_and_not_what_it_slides(friction, slides):
    """A sphere in MuJoCo, begun at 1 m/s and turning as it rolls, or without turning on a floor without friction."""
    model = mujoco.MjModel.from_xml_string(SPHERE.format(friction=friction))
    data = mujoco.MjData(model)
    data.qvel[:2] = 0.8, 0.6
    if slides == 0.0:
        data.qvel[3:6] = -0.6 / 0.02, 0.8 / 0.02, 0.0
    poses = []
    for _ in range(1000):
        mujoco.mj_step(model, data)
        poses.append(data.qpos.copy())
    places, rotations = np.array(poses)[:, None, :3], np.array(poses)[:, None, 3:]
    rolling = Rolling(0.02)
    rolled = np.concatenate([rolling.add(rotations[:300]), rolling.add(rotations[300:])])
    slide, centre = ContactSlide(), ContactSlide()
    slide.add(places - rolled, np.ones((1000, 1), dtype=bool))
    centre.add(places, np.ones((1000, 1), dtype=bool))
    assert centre.largest == pytest.approx(0.5, abs=0.005)
    assert slide.largest == pytest.approx(slides, abs=0.005)
