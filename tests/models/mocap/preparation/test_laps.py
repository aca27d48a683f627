"""The lap of a capture that begins and ends anywhere: the part that repeats best."""

import numpy as np
import pytest

from models.humanoid.skeleton import rest_pose
from models.mocap.library import embedded, load_clip
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.preparation.laps import best_lap, foot_gaps
from tests.captures import MOCAP, needs_mocap


def test_closed_clip_is_its_own_lap() -> None:
    walk = embedded("walk")
    lap = best_lap(walk)
    assert lap.clip is walk
    assert (lap.start, lap.end, lap.gap) == (0.0, walk.duration, 0.0)


@pytest.mark.parametrize(("name", "cycle"), [("walk", 132), ("run", 88)])
@pytest.mark.parametrize("first", [0, 17, 41])
def test_gait_cycle_is_found_in_an_excerpt_that_starts_anywhere(name: str, cycle: int, first: int) -> None:
    clip = embedded(name)
    poses = clip.poses[first : first + cycle + 47]
    lap = best_lap(Clip(poses, clip.fps, name))
    assert lap.clip.n_frames == cycle + 1
    assert lap.gap < 1e-3
    assert lap.end - lap.start == pytest.approx(cycle / clip.fps)
    np.testing.assert_array_equal(lap.clip.poses, poses[round(lap.start * clip.fps) :][: cycle + 1])


def test_gait_cycle_is_found_despite_noise_and_a_stop() -> None:
    clip, rng = embedded("walk"), np.random.default_rng(3)
    poses = np.concatenate([clip.poses[:200], np.repeat(clip.poses[200:201], 90, axis=0)])
    poses[:, 7:] += 0.004 * rng.standard_normal(poses[:, 7:].shape)
    poses[:, 3:] /= np.repeat(np.linalg.norm(poses[:, 3:].reshape(len(poses), -1, 4), axis=2), 4, axis=1)
    lap = best_lap(Clip(poses, clip.fps, "noisy"))
    assert abs(lap.clip.n_frames - 133) <= 2
    assert np.radians(0.5) < lap.gap < np.radians(10.0)


def test_clip_without_repetition_is_returned_unchanged() -> None:
    still = np.repeat(rest_pose()[None], 80, axis=0)
    gliding = still.copy()
    gliding[:, 0] = np.linspace(0.0, 2.0, 80)
    for poses in (still, gliding, still[:2]):
        clip = Clip(poses, 60.0, "x")
        assert best_lap(clip).clip is clip


@needs_mocap
@pytest.mark.parametrize(
    ("file", "seconds", "degrees"),
    [
        ("cmu_amc/02_01.amc", 1.1, 6.0),
        ("cmu_amc/02_03.amc", 0.77, 8.0),
        ("xia/strutting_01_000.bvh", 1.19, 4.0),
        ("deepmimic/humanoid3d_walk.txt", 1.27, 10.0),
    ],
)
def test_captured_gaits_have_laps_of_one_cycle(file: str, seconds: float, degrees: float) -> None:
    clip = load_clip(MOCAP / file)
    lap = best_lap(clip)
    assert lap.end - lap.start == pytest.approx(seconds, abs=0.03)
    assert lap.gap < np.radians(degrees)
    gaps_of_lap = pose_difference(lap.clip.displacement.moved(lap.clip.poses[0]), lap.clip.poses[-1])
    gaps_of_clip = pose_difference(clip.displacement.moved(clip.poses[0]), clip.poses[-1])
    assert np.linalg.norm(gaps_of_lap[6:]) <= np.linalg.norm(gaps_of_clip[6:])


def test_places_of_feet_are_compared_where_they_stand_in_both_frames() -> None:
    walk = embedded("walk")
    gaps = foot_gaps(walk, np.ones((walk.n_frames, 2), dtype=bool), np.array([0, walk.n_frames - 1, 30]))
    assert gaps[0, 1] < 1e-3
    assert gaps[0, 2] > 0.2
    assert not foot_gaps(walk, np.zeros((walk.n_frames, 2), dtype=bool), np.array([0, 30])).any()
