"""Clips degraded for `hvf bench`: they have the faults of captures, and preparation removes them."""

import numpy as np
import pytest

from experiments.bench.part_costs import _CLIPS, _add_capture_errors
from experiments.flights.ballistics import clip_flights
from models.mocap.library import embedded
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.well_formed import well_formed
from models.mocap.readers.own_bvh import write_bvh


@pytest.mark.parametrize("name", _CLIPS)
def test_degraded_clip_has_skate_residual_and_open_ends(name):
    clip = _add_capture_errors(embedded(name), np.random.default_rng(0))
    measures = well_formed(clip, clip_flights(clip))
    assert measures.skate > 0.015
    assert measures.residual > 0.12
    assert not measures.closed


@pytest.mark.slow
def test_degraded_clip_is_prepared_to_a_feasible_motion(tmp_path):
    write_bvh(_add_capture_errors(embedded("walk"), np.random.default_rng(0)), tmp_path / "walk.bvh")
    result = prepared(tmp_path / "walk.bvh")
    assert result.near
    assert result.seconds > 0.0
