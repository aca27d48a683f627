"""Committed gaits and flights: joint ranges, limb clearance, feet and required floor forces."""

import pytest
from clip_measures import largest_slide, limb_penetration, limit_excess, measured, residuals

from geometry.arrays import rms
from models.mocap.library import embedded

NAMES = ["walk", "run", "jump", "backflip"]


@pytest.mark.parametrize("name", NAMES)
def test_joints_stay_within_range_and_limbs_do_not_interpenetrate(name):
    assert limit_excess(embedded(name)) < 0
    assert limb_penetration(embedded(name)) < 0.008


@pytest.mark.parametrize("name", NAMES)
def test_feet_do_not_slide_or_penetrate_the_floor(name):
    assert largest_slide(measured(name)) < 0.006
    assert measured(name).soles[..., 2].min() > (-0.003 if name in ("walk", "run") else -0.004)


@pytest.mark.parametrize("name", NAMES)
def test_floor_contact_forces_suffice_to_drive_the_clip(name):
    rms_force_bound, peak_force_bound, rms_moment_bound = (
        (0.005, 0.02, 0.002) if name in ("walk", "run") else (0.015, 0.05, 0.005)
    )
    force, moment = residuals(measured(name))
    assert rms(force) < rms_force_bound
    assert force.max() < peak_force_bound
    assert rms(moment) < rms_moment_bound
