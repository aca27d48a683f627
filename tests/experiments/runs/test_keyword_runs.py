"""`hvf.run`, `hvf.load`, `hvf.prepare` and lifted maps from Python: the same results as on the command line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hvf
from experiments.cli import main
from experiments.preparation import prepared_clip
from experiments.preparation.tracking_trial import followed
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from sim.recording.recording import Recording
from tests.models.mocap.retargeting.rigs import Rig, write_rig

KEYWORDS: dict[str, Any] = {"clips": ["walk", "run"], "lap": 2.0, "figure": "none", "seconds": 0.3}


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk on a skeleton that is not the figure's."""
    walk, file = embedded("walk"), tmp_path_factory.mktemp("capture") / "walker.bvh"
    write_rig(Rig(), Clip(walk.poses[::4], walk.fps / 4, "walk"), file)
    return file


@pytest.fixture(scope="module")
def lifted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("map") / "map.npz"
    assert "2 curves" in str(hvf.lift(["walk", "cheer"], file))
    return file


@pytest.mark.usefixtures("without_page")
def test_keyword_run_equals_command_line_run(tmp_path: Path) -> None:
    run = hvf.run(**KEYWORDS)
    options = ["--clips", "walk", "run", "--lap", "2", "--figure", "none", "--seconds", "0.3", "--out"]
    assert main(["run", *options, str(tmp_path / "run")]) == 0
    with Recording(tmp_path / "run" / "run.h5") as recording:
        assert sorted(run.ticks) == sorted(recording.groups["ticks"])
        for name, values in run.ticks.items():
            np.testing.assert_array_equal(values, recording.channel("ticks", name)[:], err_msg=name)


@pytest.mark.slow
def test_recorded_keyword_run_is_reproduced_and_changed_from_its_folder(tmp_path: Path) -> None:
    hvf.run(**KEYWORDS, record=tmp_path / "run")
    assert main(["reproduce", str(tmp_path / "run")]) == 0
    changed = hvf.run(tmp_path / "run" / "config.json", seconds=0.2)
    assert changed.ticks["t"].shape == (200,)
    with pytest.raises(hvf.SimError, match="overwrite"):
        hvf.run(**KEYWORDS, record=tmp_path / "run")


def test_run_has_remarks_on_unsuitable_clips() -> None:
    run = hvf.run(**KEYWORDS | {"lap": 1.0, "clips": ["walk", "angry"]})
    assert any("times its recorded speed" in remark for remark in run.remarks)
    assert str(run).startswith(run.remarks[0])


@pytest.mark.slow
def test_lifted_curve_plays_its_clip(lifted: Path) -> None:
    lifted_map = hvf.Lifted(lifted, "cheer")
    assert lifted_map.names == ("walk", "cheer")
    field = hvf.Follow(lifted_map.around, k_r=300, b_d=8)
    run = hvf.Simulation(field=field, haptic_map=lifted_map, figure=hvf.Figure(kind="kinematic")).run(4.0)
    assert run.summary.path.deviation_rms < 1e-3
    shown, clip = run.frames["reference"][-1], lifted_map.clips[1]
    assert np.abs(clip.poses[:, 7:] - shown[7:]).max(axis=1).min() < 0.05
    other = lifted_map.clips[0]
    assert np.abs(other.poses[:, 7:] - shown[7:]).max(axis=1).min() > 0.2
    assert len(repr(lifted_map)) < 200


def test_invalid_lifted_map_or_curve_is_refused(lifted: Path, tmp_path: Path) -> None:
    with pytest.raises(hvf.ParameterError, match="no curve 'run' in the map; there are walk, cheer"):
        hvf.Lifted(lifted, "run")
    with pytest.raises(hvf.SimError, match=r"nothing\.npz"):
        hvf.Lifted(tmp_path / "nothing.npz")
    with pytest.raises(hvf.SimError, match="exists"):
        hvf.lift(["walk"], lifted)


def test_loaded_capture_is_prepared_as_in_a_run(
    capture: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    clip, raw = hvf.load(capture), hvf.load(capture, raw=True)
    assert clip.closes()
    assert not np.array_equal(clip.poses[:2], raw.poses[:2])
    np.testing.assert_array_equal(clip.poses, prepared_clip.prepared_clips([capture])[0].clip.poses)
    assert not [warning for warning in recwarn if issubclass(warning.category, UserWarning)]

    def far(self: object) -> np.ndarray:
        return np.vstack((np.r_[clip.fps, 0.0, np.zeros(73)], clip.poses))

    monkeypatch.setattr(prepared_clip, "cached_array", lambda *args: args[-1]())
    monkeypatch.setattr(prepared_clip._Capture, "_prepare", far)
    with pytest.warns(UserWarning, match=r"walker\.bvh: no feasible motion is near it"):
        hvf.load(capture)


@pytest.mark.slow
def test_prepare_returns_clip_and_measures(capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.preparation.command.followed", lambda clip, seconds: followed(clip, 1.0))
    prepared = hvf.prepare(capture, tmp_path / "ready.bvh")
    assert "well-formed" in str(prepared)
    many = prepared._replace(flights=tuple(f"flight {k}" for k in range(7)))
    assert "flight 2\n  4 more flights are refuted, as the report lists" in str(many)
    assert "flight 3" not in str(many)
    assert set(many.flights) <= set(many.faults())
    np.testing.assert_allclose(hvf.load(tmp_path / "ready.bvh").poses, prepared.clip.poses, atol=1e-5)
    with pytest.raises(hvf.ModelError, match="exists"):
        hvf.prepare(capture, tmp_path / "ready.bvh")
    with pytest.raises(hvf.ParameterError, match="loop"):
        hvf.prepare(capture, tmp_path / "other.bvh", loop=3)  # pyright: ignore[reportArgumentType]
