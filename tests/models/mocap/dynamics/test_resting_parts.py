"""Which parts of a foot rest: low, slow and for some time, by one rule for measures and preparation."""

import numpy as np
import pytest

from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.dynamics.contacts import contacts, resting_parts
from models.mocap.library import embedded
from models.mocap.preparation.poses import smoothed
from models.mocap.preparation.stances import stances

FPS = 100.0
HEEL, TOES = slice(0, 2), slice(2, 4)  # of the left foot


def soles(frames=40, height=0.0, speed=0.0):
    """Soles flat at a height [m] that move at a speed [m/s]."""
    points = np.zeros((frames, 8, 3))
    points[..., 0] = speed * np.arange(frames)[:, None] / FPS
    points[..., 2] = CONTACT_RADIUS + height
    return points


@pytest.mark.parametrize(
    ("height", "speed", "pace", "expected"),
    [
        (0.0, 0.0, 0.0, True), (-0.03, 0.0, 0.0, True), (0.044, 0.5, 0.0, True), (0.046, 0.0, 0.0, False),
        (0.0, 0.6, 0.0, False), (0.0, 0.6, 1.0, False), (0.0, 1.0, 4.0, True), (0.0, 1.0, 3.0, False),
    ],
)  # fmt: skip
def test_parts_rest_below_45_mm_and_55_cm_a_second_or_a_share_of_the_given_pace(height, speed, pace, expected):
    assert np.all(resting_parts(soles(height=height, speed=speed), FPS, pace) == expected)
    assert np.all(resting_parts(soles(height=height, speed=speed), FPS, np.full(40, pace)) == expected)


@pytest.mark.parametrize(
    ("part", "height", "speed", "expected"),
    [
        (TOES, 0.09, 0.0, [True, True]), (TOES, 0.11, 0.0, [True, False]), (TOES, 0.09, 0.3, [True, False]),
        (HEEL, 0.09, 0.0, [False, True]),
    ],
)  # fmt: skip
def test_toes_that_are_up_rest_beside_a_heel_but_no_heel_beside_toes(part, height, speed, expected):
    points = soles()
    points[:, part, 2] += height
    points[:, part, 1] = speed * np.arange(40)[:, None] / FPS
    rests = resting_parts(points, FPS)
    assert np.all(rests[:, 0] == expected)
    assert rests[:, 1].all()


@pytest.mark.parametrize(("frames", "expected"), [(2, 40), (6, 32)])
def test_a_part_that_is_up_for_less_than_50_ms_rests_throughout(frames, expected):
    points = soles()
    points[20 : 20 + frames, :4, 2] += 0.1
    # Beside the frames in which it is up it moves, one frame to each side.
    assert np.all(resting_parts(points, FPS)[:, 0].sum(axis=0) == expected)


@pytest.mark.parametrize(("frames", "expected"), [(7, 0), (8, 6)])
def test_a_part_that_is_down_for_less_than_60_ms_does_not_rest(frames, expected):
    points = soles(height=0.1)
    points[20 : 20 + frames, :4, 2] -= 0.1
    assert np.all(resting_parts(points, FPS)[:, 0].sum(axis=0) == expected)


@pytest.mark.parametrize("frames", [1, 3])
def test_soles_that_rest_throughout_do_so_in_clips_of_any_length(frames):
    assert resting_parts(soles(frames), FPS).all()
    assert not resting_parts(soles(frames, height=0.1), FPS).any()


@pytest.mark.parametrize("name", ["walk", "jump", "backflip"])
def test_feet_stand_in_the_contacts_of_a_clip_where_they_stand_for_preparation(name):
    clip = embedded(name)
    inner = slice(30, clip.n_frames - 30)
    found, schedule = contacts(clip).resting[inner, :8], stances(clip, smoothed(clip)).standing[inner]
    assert 0.2 < found.mean() < 0.9
    # Preparation goes on with a stance where the load needs it, by some frames.
    assert not (found & ~schedule).any()
    assert np.mean(schedule & ~found) < 0.02
