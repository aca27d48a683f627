"""Standing parts of a foot, by height, speed and duration: one rule for contacts and preparation."""

import numpy as np
import pytest

from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.dynamics.contacts import contacts, standing_parts
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from models.mocap.preparation.poses import smoothed
from models.mocap.preparation.stances import stances

FPS = 100.0
HEEL, TOES = slice(0, 2), slice(2, 4)  # of the left foot


def soles(frames=40, height=0.0, speed=0.0):
    """Contact spheres of flat soles at a height [m] that move at a speed [m/s]."""
    points = np.zeros((frames, 8, 3))
    points[..., 0] = speed * np.arange(frames)[:, None] / FPS
    points[..., 2] = CONTACT_RADIUS + height
    return points


def standing(points, root_speed=0.0):
    """Which parts stand under a root that moves at a speed [m/s]."""
    return standing_parts(points, np.outer(np.arange(len(points)) / FPS, (0.0, root_speed)), FPS)


@pytest.mark.parametrize(
    ("height", "speed", "root_speed", "expected"),
    [
        (0.0, 0.0, 0.0, True), (-0.03, 0.0, 0.0, True), (0.044, 0.5, 0.0, True), (0.046, 0.0, 0.0, False),
        (0.0, 0.6, 0.0, False), (0.0, 0.6, 1.0, False), (0.0, 1.0, 4.0, True), (0.0, 1.0, 3.0, False),
    ],
)  # fmt: skip
def test_sole_part_stands_below_45_mm_and_0_55_m_s_or_a_share_of_the_root_speed(height, speed, root_speed, expected):
    assert np.all(standing(soles(height=height, speed=speed), root_speed) == expected)


@pytest.mark.parametrize(
    ("part", "height", "speed", "expected"),
    [
        (TOES, 0.09, 0.0, [True, True]), (TOES, 0.11, 0.0, [True, False]), (TOES, 0.09, 0.3, [True, False]),
        (HEEL, 0.09, 0.0, [False, True]),
    ],
)  # fmt: skip
def test_raised_toes_stand_beside_a_standing_heel_but_not_vice_versa(part, height, speed, expected):
    points = soles()
    points[:, part, 2] += height
    points[:, part, 1] = speed * np.arange(40)[:, None] / FPS
    stands = standing(points)
    assert np.all(stands[:, 0] == expected)
    assert stands[:, 1].all()


@pytest.mark.parametrize(("frames", "expected"), [(2, 40), (6, 32)])
def test_lift_shorter_than_50_ms_does_not_interrupt_a_stance(frames, expected):
    points = soles()
    points[20 : 20 + frames, :4, 2] += 0.1
    # It also counts as moving in one frame on each side of the lift.
    assert np.all(standing(points)[:, 0].sum(axis=0) == expected)


@pytest.mark.parametrize(("frames", "expected"), [(7, 0), (8, 6)])
def test_contact_shorter_than_60_ms_is_no_stance(frames, expected):
    points = soles(height=0.1)
    points[20 : 20 + frames, :4, 2] -= 0.1
    assert np.all(standing(points)[:, 0].sum(axis=0) == expected)


@pytest.mark.parametrize("frames", [1, 3])
def test_permanent_stance_is_found_in_clips_of_one_and_three_frames(frames):
    assert standing(soles(frames)).all()
    assert not standing(soles(frames, height=0.1)).any()


@pytest.mark.parametrize("name", ["walk", "run", "jump", "backflip"])
def test_resting_contacts_agree_with_the_stances_of_preparation(name):
    clip = embedded(name)
    inner = slice(30, clip.n_frames - 30)
    rests, stands = contacts(clip).resting[inner, :8], stances(clip, smoothed(clip)).standing[inner]
    assert 0.2 < rests.mean() < 0.9
    assert not (rests & ~stands).any()
    # Preparation extends a stance where the load requires it, and the foot of a runner rolls too fast to rest.
    assert np.mean(stands & ~rests) < 0.03


def test_standing_foot_of_a_runner_rests_unless_it_moves_before_and_after():
    clip = embedded("run")
    points, rests = sole_points(clip.poses), contacts(clip).resting[:, :8]
    stands = np.repeat(standing_parts(points, clip.poses[:, :2], clip.fps), 2, axis=2).reshape(-1, 8)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2) * clip.fps
    moves = (steps[:-1] > 0.55) & (steps[1:] > 0.55)
    rolls = stands[1:-1] & ~rests[1:-1]
    assert rolls.any()
    assert not (rolls & ~moves).any()
    assert not (rests[1:-1] & moves).any()


def test_stance_continues_across_the_ends_of_a_lap_and_the_seam_of_a_closed_clip():
    walk = embedded("walk")
    lap, whole = walk.n_frames - 1, contacts(walk)
    lands = int(np.flatnonzero(np.diff(whole.planted[:, 0].astype(int)) > 0)[0]) + 1
    # A lap that begins 3 frames after the foot lands, and so ends with the first 25 ms of its next stance.
    turned = (np.arange(lap) + lands + 3) % lap
    laps = np.vstack([walk.poses[:-1], walk.displacement.moved(walk.poses)])
    moved = Clip(laps[lands + 3 : lands + 3 + lap + 1], walk.fps, "later")
    planted = contacts(moved).planted[:-1, 0]
    assert planted[-3:].all()
    np.testing.assert_array_equal(planted[10:-10], whole.planted[turned, 0][10:-10])
