"""Clips of a run: a motion file is prepared once, cached by its content, and taken unprepared only on request."""

from pathlib import Path

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.setups.parts.clips import load_clips
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip
from models.mocap.preparation import prepare
from models.mocap.preparation.looping import LoopedClip
from models.mocap.readers.own_bvh import write_bvh
from tests.models.mocap.retargeting.rigs import Rig, random_rig, write_rig


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    path = tmp_path / "captured.bvh"
    write_rig(random_rig(np.random.default_rng(4)), embedded("cheer"), path)
    return path


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """Files that were prepared, by a fast replacement of the preparation."""
    found: list[Path] = []

    class QuickPreparation:
        def __init__(self, path: Path, loop: str = "auto"):
            found.append(path)
            loaded = load(path).clip
            self.looped = LoopedClip(loaded, "cycle", 0.25, 1.5, 0.1)
            self.near = path.stem != "cartwheel"
            self.clip = Clip(loaded.poses[::2], loaded.fps / 2.0, loaded.name)

    QuickPreparation.__module__ = prepare.__name__
    monkeypatch.setattr(prepare, "prepared", QuickPreparation)
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path / "cache"))
    return found


def test_foreign_file_is_prepared_once_and_cached_exactly(foreign: Path, calls: list[Path]) -> None:
    (first,), remarks = load_clips([str(foreign)])
    (again,), _ = load_clips([str(foreign)])
    assert calls == [foreign]
    np.testing.assert_array_equal(first.poses, again.poses)
    assert first.fps == again.fps == load(foreign).clip.fps / 2.0
    assert any("--raw" in remark for remark in remarks)


def test_best_lap_is_prepared_and_cached_apart(foreign: Path, calls: list[Path]) -> None:
    load_clips([str(foreign)])
    for _ in range(2):
        _, remarks = load_clips([str(foreign)], loop="lap")
        assert "prepared from 0.25 to 1.50 s, the lap that repeats itself best (its ends were 6° apart)" in remarks[-1]
    assert len(calls) == 2


def test_capture_without_near_feasible_motion_is_reported(foreign: Path, calls: list[Path]) -> None:
    far = foreign.rename(foreign.with_stem("cartwheel"))
    for _ in range(2):
        _, remarks = load_clips([str(far)])
        assert "no feasible motion is near it" in remarks[-1]
    assert len(calls) == 1


def test_changed_content_under_the_same_name_is_prepared_anew(foreign: Path, calls: list[Path]) -> None:
    load_clips([str(foreign)])
    write_rig(random_rig(np.random.default_rng(4)), embedded("angry"), foreign)
    load_clips([str(foreign)])
    assert len(calls) == 2


def test_raw_option_skips_preparation(foreign: Path, calls: list[Path]) -> None:
    (clip,), _ = load_clips([str(foreign)], raw=True)
    np.testing.assert_array_equal(clip.poses, load(foreign).clip.poses)
    assert not calls


@pytest.mark.parametrize("raw", [True, False])
def test_capture_remarks_name_only_missing_joints(tmp_path: Path, calls: list[Path], raw: bool) -> None:
    path = tmp_path / "captured.bvh"
    write_rig(Rig(without=("clavicle",)), embedded("cheer"), path)
    _, remarks = load_clips([str(path)], raw)
    assert remarks[0] == "captured.bvh: missing: left_clavicle (follows chest), right_clavicle (follows chest)"
    assert not any(word in remark for remark in remarks for word in ("taken: ", "unused: ", "axes: ", "unit: "))
    assert bool(calls) is not raw


def test_own_files_and_embedded_clips_are_not_prepared(tmp_path: Path, calls: list[Path]) -> None:
    write_bvh(embedded("walk"), tmp_path / "own.bvh")
    clips, remarks = load_clips(["walk", str(tmp_path / "own.bvh")])
    np.testing.assert_allclose(clips[0].poses, clips[1].poses, atol=1e-5)
    assert not calls
    assert not remarks


def test_own_file_that_neither_closes_nor_rests_at_its_ends_is_prepared(tmp_path: Path, calls: list[Path]) -> None:
    """As an edited animation or a converted capture: closed over its ends, its feet slid by up to 1.5 m."""
    walk, path = embedded("walk"), tmp_path / "edited.bvh"
    write_bvh(Clip(walk.poses[:140], walk.fps, "edited"), path)
    assert load_clips([str(path)])[1] == ("edited.bvh: prepared; --raw takes the capture as it is",)
    write_bvh(Clip(walk.poses[:240], walk.fps, "edited"), path)
    part = "prepared from 0.25 to 1.50 s, its cycle (hvf prepare --loop open keeps all)"
    assert part in load_clips([str(path)])[1][-1]
    assert calls == [path, path]
    assert load_clips([str(path)], raw=True)[1] == ()


def test_own_file_at_rest_at_both_ends_is_prepared_for_leading_only(tmp_path: Path, calls: list[Path]) -> None:
    walk, path = embedded("walk"), tmp_path / "own.bvh"
    still = np.vstack((walk.poses[[0, 0]], walk.poses, walk.poses[[-1, -1]]))
    still[:2, 2] += 0.01  # it does not close
    write_bvh(Clip(still, walk.fps, "own"), path)
    load_clips([str(path)])
    assert not calls
    load_clips([str(path)], loop="lap")
    assert calls == [path]


def test_raw_option_is_stored_in_the_configuration() -> None:
    assert not run_config(clips=("walk",)).map.raw
    assert run_config(clips=("walk",), raw=True).map.raw
    assert run_config(mode="lead", raw=True).map.raw
