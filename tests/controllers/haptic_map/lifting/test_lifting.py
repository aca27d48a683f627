"""Lifting as a whole: angles, sites and figures of the curves, special cases and invalid arguments."""

from functools import cache

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.lift import lift
from controllers.haptic_map.lifting.room import Room
from tests.controllers.clips_for_maps import swinging
from tests.controllers.haptic_map.lifting.swinging_motions import ROOM, WEIGHTS, lifted_at, motion

FOUR = [motion(swinging(k, frames=60 + 20 * k, amplitude=0.3 + 0.2 * k), f"clip {k}") for k in range(4)]


@cache
def four_lifted():
    return lifted_at(FOUR)


def test_angles_increase_and_leave_a_gap_for_open_clips():
    clips = [*FOUR[:2], motion(swinging(3)[:70], "open", closed=False)]
    found = lifted_at(clips)
    for clip, angles in zip(clips, found.angles, strict=True):
        assert angles.shape == (len(clip.poses),)
        assert (np.diff(angles) > 0.0).all()
        if clip.closed:
            assert angles[-1] - angles[0] == pytest.approx(2.0 * np.pi, abs=1e-12)
        else:
            assert angles[0] > 0.0
            assert 2.0 * np.pi * 0.7 - 1e-9 <= angles[-1] - angles[0] <= 2.0 * np.pi * 0.9 + 1e-9
            assert angles[-1] < 2.0 * np.pi
    # Pace and its change are continuous: third differences are small relative to the step.
    step = np.diff(found.angles[0])
    assert np.abs(np.diff(step, 2)).max() < 0.02 * step.mean()


@pytest.mark.slow
def test_sites_stay_inside_and_apart():
    lifted = four_lifted()
    low, high = ROOM.rectangle.low, ROOM.rectangle.high
    assert (lifted.sites >= low - 1e-12).all()
    assert (lifted.sites <= high + 1e-12).all()
    assert lifted.after.separation >= ROOM.separation


def test_reported_curve_figures_match_those_of_the_map():
    """Independent computation: the trajectories of the map made from the lifted clips."""
    lifted = four_lifted()
    h = Lifted([(m.poses, m.fps) for m in FOUR], [True] * 4, lifted.angles, lifted.sites)
    for i, curve in enumerate(lifted.after.curves):
        path = h.curve(i)
        t = np.linspace(path.start, path.end, 800)
        assert np.linalg.norm(path.velocity(t), axis=1).max() == pytest.approx(curve.speed, rel=0.02)
        assert 1.0 / path.curvature(t).max() == pytest.approx(curve.radius, rel=0.05)
        assert np.linalg.norm(path.acceleration(t), axis=1).max() == pytest.approx(curve.acceleration, rel=0.1)
    for m, poses in zip(FOUR, (h.placed(i) for i in range(4)), strict=True):
        np.testing.assert_allclose(poses[:, 7:], m.poses[:, 7:], atol=1e-12)


@pytest.mark.slow
def test_same_seed_gives_the_same_curves():
    lifted = four_lifted()
    again = lifted_at(FOUR)
    np.testing.assert_array_equal(again.sites, lifted.sites)
    for a, b in zip(again.angles, lifted.angles, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.slow
def test_acceleration_limit_keeps_fast_clips_where_the_device_can_follow():
    # The fast clip lies between the other two; at the innermost radius its acceleration is 0.4 of that there.
    three = [motion(swinging(1, amplitude=a), f"{a}", fps=fps) for a, fps in ((0.2, 30.0), (0.4, 150.0), (0.6, 30.0))]
    wide = (0.02, 0.072)
    unlimited = lifted_at(three, Room(wide, acceleration=100.0)).after.curves[1].acceleration
    limited = lifted_at(three, Room(wide, acceleration=0.7 * unlimited)).after.curves[1].acceleration
    assert 0.6 * unlimited < limited <= 0.7 * unlimited


def test_clips_of_any_length_and_rate_are_lifted():
    clips = [motion(swinging(1, frames=40), "short", 25.0), motion(swinging(2, frames=500), "long", 120.0)]
    found = lifted_at(clips)
    h = Lifted([(m.poses, m.fps) for m in clips], [True, True], found.angles, found.sites)
    assert h.curve(0).duration == pytest.approx(40 / 25)
    assert h.curve(1).duration == pytest.approx(500 / 120)
    assert found.after.separation >= ROOM.separation


@pytest.mark.slow
def test_duplicate_clips_are_reported_and_kept_apart():
    found = lifted_at([FOUR[0], motion(FOUR[0].poses, "again"), FOUR[1]])
    assert found.same == ((0, 1),)
    assert all({t.first, t.second} != {0, 1} for t in found.transitions)
    assert found.after.separation >= ROOM.separation


def test_still_clip_is_reported_and_has_a_curve():
    found = lifted_at([FOUR[0], motion(np.tile(FOUR[1].poses[:1], (31, 1)), "still")])
    assert found.still == (1,)
    assert np.isfinite(found.sites).all()
    assert found.after.separation >= ROOM.separation


def test_single_clip_has_a_curve():
    found = lifted_at(FOUR[:1])
    assert found.after.separation == np.inf
    assert found.transitions == ()


def cut_short():
    return swinging(3)[:80]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: lifted_at([]), "no clips to lift"),
        (lambda: lifted_at([motion(swinging(1)[:1], "one")]), "clip 'one': a clip needs at least 2 frames, got 1"),
        (lambda: lifted_at([motion(swinging(1)[:3], "few", closed=False)]), "'few' has 3 frames, and a curve needs 4"),
        (lambda: lifted_at([motion(cut_short(), "cut")]), "'cut' is given as cyclic.*lift it as an open"),
        (lambda: lifted_at([FOUR[0], FOUR[1]], Room(separation=0.2)), "2 clips do not fit 200 mm apart .* 1 do"),
        (lambda: lifted_at([FOUR[0]] * 120, Room(separation=0.008)), r"120 clips do not fit.*separation of \d\.\d mm"),
        (lambda: lifted_at([motion(swinging(1), "fast", fps=3000.0)]), "'fast' goes round in 0.04 s.*slow it down to"),
        (lambda: lift([FOUR[0]], WEIGHTS[:2], ROOM, np.random.default_rng(0)), "4 rotations, there are 2 weights"),
        (lambda: Room(approach=0.02), "approach at transitions is 20 mm, more than the separation"),
        (lambda: Room(r_range=(0.05, 0.02)), "r_range must increase"),
        (lambda: Room(separation=np.nan), "separation"),
        (lambda: motion(swinging(1), supports=np.ones((3, 2), bool)), "supports have shape"),
    ],
)  # fmt: skip
def test_impossible_lifts_raise_parameter_error_with_a_remedy(make, message):
    with pytest.raises(ParameterError, match=message):
        make()
