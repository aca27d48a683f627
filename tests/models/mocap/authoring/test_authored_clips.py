"""Gaits and flights alike: feet, joints and limbs of the committed clips, and what the floor must give them."""

import pytest
from clip_measures import limit_excess, measured, overlap, residuals, rms, slide

from models.mocap.library import embedded

NAMES = ["walk", "run", "jump", "backflip"]


@pytest.mark.parametrize("name", NAMES)
def test_joints_stay_inside_their_ranges_and_limbs_out_of_one_another(name):
    assert limit_excess(embedded(name)) < 0
    assert overlap(embedded(name)) < 0.008


@pytest.mark.parametrize("name", NAMES)
def test_feet_do_not_slide_nor_sink(name):
    assert slide(measured(name)) < 0.006
    assert measured(name).soles[..., 2].min() > (-0.003 if name in ("walk", "run") else -0.004)


@pytest.mark.parametrize("name", NAMES)
def test_floor_contact_alone_can_drive_it(name):
    lacking, most, turning = (0.005, 0.02, 0.002) if name in ("walk", "run") else (0.015, 0.05, 0.005)
    force, moment = residuals(measured(name))
    assert rms(force) < lacking
    assert force.max() < most
    assert rms(moment) < turning
