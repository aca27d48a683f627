"""The filter across rivers: a figure changes over gradually, and is otherwise where the hand is."""

import numpy as np
import pytest

from controllers.fields.algebra.instructions import TRACE_RIVER, TRACE_SIZE
from sim.reference.cross_track import no_cross_track, packed_cross_track, shift_across

RATE, PERIOD = 3.0, 2e-3
ANGLES = np.arange(64) * 2.0 * np.pi / 64
SITES = np.stack([
    np.column_stack([0.050 + 0.004 * np.cos(ANGLES), 0.010 * np.sin(ANGLES)]),
    np.column_stack([0.062 - 0.003 * np.sin(ANGLES), -0.020 + 0.0 * ANGLES]),
    np.column_stack([0.045 + 0.0 * ANGLES, 0.030 + 0.002 * np.cos(2.0 * ANGLES)]),
], axis=1)  # fmt: skip


def site(river, angle):
    """(r, z) of a river; its splines follow these functions within 1e-8 m."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([
        [0.050 + 0.004 * c, 0.010 * s],
        [0.062 - 0.003 * s, -0.020 + 0.0 * s],
        [0.045 + 0.0 * s, 0.030 + 0.002 * np.cos(2.0 * angle)],
    ][river], axis=-1)  # fmt: skip


def shown(times, rivers, offset=0.0):
    """Place (r, z) and angle at which the map is evaluated, of a hand on its river, or off it by an offset in r."""
    params, state, result = packed_cross_track(RATE, SITES), no_cross_track(), []
    for t, river in zip(times, rivers, strict=True):
        angle = 2.0 * t
        r, z = site(max(river, 0), angle)
        p, trace = np.array([(r + offset) * np.cos(angle), (r + offset) * np.sin(angle), z]), np.zeros(TRACE_SIZE)
        trace[TRACE_RIVER] = river
        shift_across(params, state, trace, p, PERIOD)
        result.append([np.hypot(p[0], p[1]), p[2], np.arctan2(p[1], p[0])])
    return np.array(result)


TIMES = np.arange(0.0, 4.0, PERIOD)
WAVES = np.exp(1j * 2.0 * TIMES)


@pytest.mark.parametrize("river", [0, 1, 2, -1])
def test_hand_on_its_river_or_on_none_is_shown_where_it_is(river):
    places = shown(TIMES, np.full(len(TIMES), river))
    np.testing.assert_allclose(places[:, :2], site(max(river, 0), 2.0 * TIMES), atol=1e-7)
    np.testing.assert_allclose(np.exp(1j * places[:, 2]), WAVES, atol=1e-12)


def test_share_of_the_new_river_follows_a_step_with_critical_damping_and_the_phase_is_the_hands():
    rivers = np.where(TIMES < 1.0, 0, 1)
    places = shown(TIMES, rivers)
    first, second = site(0, 2.0 * TIMES), site(1, 2.0 * TIMES)
    since = np.maximum(TIMES - 1.0 + PERIOD, 0.0)
    share = 1.0 - (1.0 + RATE * since) * np.exp(-RATE * since)
    np.testing.assert_allclose(places[:, :2], first + share[:, None] * (second - first), atol=1e-6)
    np.testing.assert_allclose(np.exp(1j * places[:, 2]), WAVES, atol=1e-12)


def test_hand_that_stays_beside_its_river_is_shown_there_after_a_while():
    rivers, offsets = np.zeros(len(TIMES), int), 0.003 * (TIMES > 1.0)
    params, state, radii = packed_cross_track(RATE, SITES), no_cross_track(), []
    for t, river, offset in zip(TIMES, rivers, offsets, strict=True):
        angle, trace = 2.0 * t, np.zeros(TRACE_SIZE)
        r, z = site(river, angle)
        p = np.array([(r + offset) * np.cos(angle), (r + offset) * np.sin(angle), z])
        shift_across(params, state, trace, p, PERIOD)
        radii.append(np.hypot(p[0], p[1]) - r)
    radii = np.array(radii)
    np.testing.assert_allclose(radii[TIMES < 1.0], 0.0, atol=1e-7)
    assert radii[np.searchsorted(TIMES, 1.0 + 0.56)] == pytest.approx(0.0015, abs=1e-4)
    assert radii[-1] == pytest.approx(0.003, abs=1e-5)


@pytest.mark.parametrize("then", [0, 2])
def test_change_that_is_interrupted_goes_on_from_where_it_is_at_the_same_speed(then):
    rivers = np.select([TIMES < 1.0, TIMES < 1.4], [0, 1], then)
    places = shown(TIMES, rivers)[:, :2]
    speed = np.diff(places, axis=0) / PERIOD
    # At most ω/e of a way of 50 mm, 55 mm/s, and the curves' own 20 mm/s.
    assert np.abs(speed).max() < 0.075
    # The share's speed is kept; the curves' relative one, up to 28 mm/s, is not.
    assert np.abs(np.diff(speed, axis=0)).max() < 0.028
    np.testing.assert_allclose(places[-1], site(then, 2.0 * TIMES[-1]), atol=3e-4)
