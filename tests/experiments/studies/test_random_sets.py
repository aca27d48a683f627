"""A random set of captures, by the functions of the study: the figure stands and feet stay in place."""

import pytest

from experiments.preparation.tracking_trial import followed
from experiments.studies import random_sets
from models.mocap.library import load_clip
from models.mocap.preparation.bounds import MAX_RESIDUAL
from tests.captures import MOCAP, needs_mocap

FILES = ("snu/walk.bvh", "xia/strutting_01_000.bvh", "cmu_amc/02_01.amc", "xia/dme_example.bvh")


@pytest.fixture
def captures(monkeypatch):
    """The folder; runs are shortened to 6 s, a lap and most of the second one, in which the hand pushes."""
    monkeypatch.setattr(random_sets, "RUN_SECONDS", 6.0)
    monkeypatch.setattr(random_sets, "followed", lambda clip: followed(clip, 6.0))
    return str(MOCAP)


@needs_mocap
@pytest.mark.slow
def test_random_set_stands_without_skating(captures):
    found = [random_sets.captured(captures, name) for name in FILES]
    assert [one.name for one, _ in found if one.reason or one.alone > MAX_RESIDUAL] == []
    chosen = next(random_sets.drawn([clip for _, clip in found], 4, seed=1))
    assert sorted(clip.name for clip in chosen) == sorted(FILES)
    row = random_sets.run_set(0, "cylindrical", chosen, 1, "push", captures)
    assert row["off_pace"] == ()
    assert row["fell"] is None
    assert 0.0 < row["residual"] <= 0.12
    assert row["lowest"] > -1.0
    assert row["skate"] <= 2.0
    assert row["beyond"] == 0.0
    assert "| cylindrical | 1, 0 | 1, " in random_sets.summary([row])[-1]


@needs_mocap
def test_unprepared_walk_exceeds_the_bounds(captures):
    walk = load_clip(MOCAP / "snu/walk.bvh")
    found = random_sets.animation_measures(walk.poses, walk.fps)
    assert found["lowest"] < -1.0
    assert found["skate"] > 2.0
