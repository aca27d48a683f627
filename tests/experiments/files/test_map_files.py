"""Map files: exact round trip, refusal of other files, and runs that take their map from a file."""

import json
import random
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from experiments.cli import main
from experiments.config.options import run_config
from experiments.config.part import to_dict
from experiments.files.map_files import load_figure_map, load_map, map_digest, save_map, write_arrays
from experiments.fitting.figure_legs import figure_legs
from experiments.results.folder import RECORDING
from experiments.setups.wiring import wire
from models.mocap.library import embedded
from models.world.scene import SceneConfig
from sim.errors import SimError
from sim.recording.recorder import Group, Recorder
from sim.world.world import World
from tests.experiments.refused_command import refused


@cache
def clips():
    return [(clip.poses, clip.fps) for clip in map(embedded, ("walk", "angry", "jump"))]


@cache
def legs():
    return figure_legs(World(SceneConfig()).body)


@cache
def lifted():
    lap = np.arange(16)[:, None] * 2.0 * np.pi / 16
    around = np.arange(3) * 2.0 * np.pi / 3 + 0.2 * np.sin(lap)
    sites = np.stack([0.045 + 0.01 * np.cos(around), 0.01 * np.sin(around)], axis=-1)
    angles = [np.linspace(0.0, 2.0 * np.pi, len(poses)) for poses, _ in clips()[:2]]
    angles.append(np.linspace(0.2, 5.5, len(clips()[2][0])))
    return Lifted(clips(), [True, True, False], angles, sites, legs(), ("walk", "a/b", "../jump"))


def test_map_round_trips_exactly_through_its_file(tmp_path):
    haptic_map, path = lifted(), tmp_path / "map.npz"
    save_map(haptic_map, path)
    again = load_map(path)
    assert again.names == haptic_map.names
    np.testing.assert_array_equal(again.compiled().params, haptic_map.compiled().params)
    for x in np.random.default_rng(0).uniform([0.02, -0.04, -0.03], [0.05, 0.04, 0.03], (20, 3)):
        stylus = np.append(x, [1.0, 0.0, 0.0, 0.0])
        np.testing.assert_array_equal(again.pose(stylus), haptic_map.pose(stylus))


def test_damaged_map_file_is_refused_by_name(tmp_path):
    whole, damaged = tmp_path / "whole.npz", tmp_path / "damaged.npz"
    save_map(lifted(), whole)
    data, rng = whole.read_bytes(), np.random.default_rng(1)
    for _ in range(40):
        cut = int(rng.integers(len(data)))
        damaged.write_bytes(data[:cut])
        with pytest.raises(SimError, match=r"damaged\.npz"):
            load_map(damaged)
    for _ in range(40):
        at = int(rng.integers(len(data) - 64))
        flipped = bytearray(data)
        flipped[at : at + 64] = rng.bytes(64)
        damaged.write_bytes(bytes(flipped))
        # Damage in the padding of the archive is harmless: the map is either read completely or refused.
        try:
            again = load_map(damaged)
        except SimError:
            continue
        np.testing.assert_array_equal(again.compiled().params, lifted().compiled().params)


def test_file_of_another_content_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "other.npz"
    with monkeypatch.context() as patch:
        patch.setattr("experiments.files.map_files.KIND", "Cylindrical")
        write_arrays(path, {"one": np.zeros(3)})
    with pytest.raises(SimError, match=r"other\.npz: holds a map of kind 'Cylindrical'; expected what hvf lift writes"):
        load_map(path)
    np.savez(path, a=np.zeros(3))
    with pytest.raises(SimError, match="is not a map file"):
        load_map(path)
    np.save(path.with_suffix(".npy"), np.zeros(3))
    path.with_suffix(".npy").rename(path)
    with pytest.raises(SimError, match="is not a map file"):
        load_map(path)
    message = r"missing\.npz: cannot be read \(No such file or directory\); expected the \.npz file of a map"
    with pytest.raises(SimError, match=message):
        load_map(tmp_path / "missing.npz")


@pytest.mark.parametrize("key", ["clip/walk/fps", "closed/a/b", "sites", "limb/1/axis", "margin", "angles/../jump"])
def test_map_file_with_missing_or_wrong_array_is_refused(key, tmp_path):
    path, arrays = tmp_path / "map.npz", lifted().arrays()
    del arrays[key]
    write_arrays(path, arrays)
    with pytest.raises(SimError, match=f"the map lacks '{key}'"):
        load_map(path)
    arrays[key] = np.zeros((1, 2, 3, 4))
    write_arrays(path, arrays)
    with pytest.raises(SimError, match=r"of the map has shape \(1, 2, 3, 4\)"):
        load_map(path)
    arrays[key] = np.array(["words"])
    write_arrays(path, arrays)
    with pytest.raises(SimError, match="does not hold numbers"):
        load_map(path)


def test_map_file_of_another_format_version_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "map.npz"
    monkeypatch.setattr("experiments.files.map_files.VERSION", 2)
    write_arrays(path, {})
    monkeypatch.undo()
    with pytest.raises(SimError, match="of version 2 of the format, this program reads 1"):
        load_map(path)


def test_run_takes_map_and_clips_from_a_file(tmp_path):
    path = tmp_path / "map.npz"
    save_map(lifted(), path)
    session = wire(run_config(map=str(path), seconds=1.0))
    assert [clip.name for clip in session.clips] == ["walk", "a/b", "../jump"]
    np.testing.assert_array_equal(session.haptic_map.compiled().params, lifted().compiled().params)
    assert any("clips are those of the map: walk, a/b" in remark for remark in session.remarks)


def test_map_with_another_pose_size_is_refused(tmp_path):
    path = tmp_path / "map.npz"
    poses, fps = clips()[0]
    angles = np.linspace(0.0, 2.0 * np.pi, len(poses))
    save_map(Lifted([(poses[:, :19], fps)], [True], [angles], np.tile([0.045, 0.0], (16, 1, 1))), path)
    with pytest.raises(SimError, match="its poses have 19 numbers, the figure's have 75"):
        load_figure_map(path)


@pytest.mark.slow
@pytest.mark.usefixtures("without_region")
def test_map_file_is_certified_along_all_curves_with_its_clips(tmp_path, capsys):
    path = tmp_path / "map.npz"
    save_map(lifted(), path)
    command = ["certify", "--map", str(path), "--no-hand", "--json", "--out", str(tmp_path)]
    assert main(command) == 0
    result = json.loads(capsys.readouterr().out)
    assert {name for name in result if name.startswith("stability")} == {
        "stability", "stability_a/b", "stability_../jump",
    }  # fmt: skip
    assert result["ballistic"]["figures"]["clips"] == {"walk": "certified", "a/b": "certified", "../jump": "certified"}
    assert main([*command, "--verify", str(tmp_path / "certificate.json")]) == 0
    assert main([*command, "--curve", "a/b", "--verify", str(tmp_path / "certificate.json")]) == 1
    assert "changed: curve;" in capsys.readouterr().err
    assert main([*command, "--curve", "hop"]) == 2


def test_run_with_changed_map_file_is_not_reproduced(tmp_path, capsys):
    path, folder = tmp_path / "map.npz", tmp_path / "run"
    folder.mkdir()
    save_map(lifted(), path)
    config = run_config(map=str(path), seconds=1.0)
    static = wire(config).static()
    groups = {"ticks": Group(1000.0, {"t": ()}), "frames": Group(100.0, {"t": ()})}
    with Recorder(folder / RECORDING, to_dict(config), 1, groups, static) as recorder:
        recorder.append("ticks", {"t": np.zeros(1)})
    write_arrays(path, lifted().arrays() | {"margin": np.array([5e-3])})
    assert main(["reproduce", str(folder)]) == 2
    stderr = capsys.readouterr().err
    assert f"{path}: the map has changed since the run was recorded" in stderr
    assert map_digest(path)[:12] in stderr
    assert str(static["map_sha256"])[:12] in stderr
    path.unlink()
    assert main(["reproduce", str(folder)]) == 2
    assert "No such file" in capsys.readouterr().err


@pytest.mark.parametrize("content", ["noise", "pickled", "text"])
def test_non_map_file_is_refused_without_mentioning_pickle(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "map.npz"
    if content == "pickled":
        np.savez(path, version=np.array([1, None], dtype=object), kind="Lifted", keys=[])
    else:
        path.write_bytes(random.Random(1).randbytes(3000) if content == "noise" else b"hello")
    stderr = refused(["run", "--map", str(path), "--out", str(tmp_path / "run")], capsys)
    assert stderr.endswith("is not a map file, or damaged; expected what hvf lift writes\n")
    assert "pickle" not in stderr
