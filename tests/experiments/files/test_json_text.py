"""JSON output is strict JSON for any measured value."""

import json

import h5py
import numpy as np
import pytest

from controllers.errors import ParameterError
from experiments.cli import main
from experiments.config.options import run_config
from experiments.config.paths import load_config
from experiments.files.json_text import json_text
from experiments.results.folder import config_of
from experiments.setups.parts.defaults import resolved
from sim.recording.recording import Recording


def strictly(text: str) -> object:
    """The value, by a parser that refuses NaN and Infinity."""

    def refuse(constant: str) -> None:
        raise ValueError(constant)

    return json.loads(text, parse_constant=refuse)


def test_non_finite_numbers_become_null() -> None:
    value = {"a": np.inf, "b": [1.5, (float("nan"), "Infinity")], "c": {"d": np.float64(-np.inf), "e": 2, "f": None}}
    assert strictly(json_text(value)) == {
        "a": None,
        "b": [1.5, [None, "Infinity"]],
        "c": {"d": None, "e": 2, "f": None},
    }


@pytest.mark.usefixtures("without_page")
def test_infinite_configuration_values_are_strict_json_in_all_run_files(tmp_path) -> None:
    words = ["--figure", "none", "--walls", "--joint-speed", "inf", "--tube", "inf", "--seconds", "0.1"]
    assert main(["run", *words, "--out", str(tmp_path)]) == 0
    config = resolved(run_config(figure="none", walls=True, joint_speed=np.inf, tube=np.inf, seconds=0.1, flow="curve"))
    text = (tmp_path / "config.json").read_text(encoding="utf-8")
    assert strictly(text)["mode"]["tube"] == "Infinity"  # pyright: ignore
    assert load_config(tmp_path / "config.json") == config
    strictly((tmp_path / "summary.json").read_text(encoding="utf-8"))
    with h5py.File(tmp_path / "run.h5") as file:
        assert strictly(file["config"][()].decode())["mode"] == strictly(text)["mode"]  # pyright: ignore
        strictly(bytes(file["summary"][:]).decode())  # pyright: ignore
    with Recording(tmp_path / "run.h5") as recording:
        assert config_of(recording) == config


def test_nonstandard_infinity_token_is_read(tmp_path) -> None:
    (tmp_path / "mine.json").write_text('{"mode": {"kind": "follow", "tube": Infinity}}', encoding="utf-8")
    assert load_config(tmp_path / "mine.json") == run_config(tube=np.inf)
    (tmp_path / "mine.json").write_text('{"mode": {"kind": "follow", "stiffness": "Infinity"}}', encoding="utf-8")
    with pytest.raises(ParameterError, match=r"stiffness is inf; expected .* finite"):
        load_config(tmp_path / "mine.json")


@pytest.mark.slow
def test_lift_report_of_singular_map_is_strict_json(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lift", "walk", "--out", str(tmp_path / "map.npz"), "--json"]) == 0
    report = strictly(capsys.readouterr().out)
    assert isinstance(report, dict)
    assert report["quality"]["conditioning"][1] is None
