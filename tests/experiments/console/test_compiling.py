"""Compilation before a run: its units are known before wiring, and only missing ones are compiled."""

import os
import sys
from pathlib import Path

import pytest
from numba import typeof, types
from rich.console import Console

from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.console.compiling import compiler
from experiments.setups.wiring import wire
from sim.compilation import workers
from sim.compilation.unit_workers import compile_units, missing_units
from sim.compilation.units import Unit, unit_function
from sim.errors import SimError

TOYS = Path(__file__).parents[2] / "sim" / "compilation"


class _UnitsAnnounced(Exception):
    """Ends wiring once it has announced its units."""


def _names(units: tuple[Unit, ...]) -> list[str]:
    return [unit.name for unit in units]


def _stop(units: tuple[Unit, ...]) -> None:
    raise _UnitsAnnounced(units)


@pytest.fixture
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Unit, ...]:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(TOYS), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.syspath_prepend(str(TOYS))
    unit_function.cache_clear()
    monkeypatch.delitem(sys.modules, "toy_kernels", raising=False)  # as imported for another cache folder
    import toy_kernels  # pyright: ignore[reportMissingImports]

    vector = types.Array(types.float64, 1, "C")
    spring = typeof(toy_kernels.Spring(1.0, 0.0))
    return (
        Unit.of(toy_kernels.other, types.float64, vector),
        Unit.of(toy_kernels.force, spring, types.float64, vector),
    )


@pytest.mark.slow
def test_missing_units_are_compiled_in_parallel_and_reported_once(toys, capsys):
    assert missing_units((*toys, *toys)) == (toys[1], toys[0])
    compiler(Console())(toys)
    stdout = capsys.readouterr().out
    assert "Compiling" in stdout
    assert "2 of 2" in stdout
    assert missing_units(toys) == ()
    compiler(Console())(toys)
    assert not capsys.readouterr().out


@pytest.mark.slow
def test_only_missing_units_are_compiled(toys):
    compiled: list[Unit] = []
    toys[0].load()
    compile_units(toys, compiled.append)
    assert compiled == [toys[1]]


@pytest.mark.slow
def test_unit_that_fails_to_compile_stays_missing(toys):
    compiled: list[Unit] = []
    wrong = Unit(toys[0].module, "other", (types.float64, types.float64))
    compile_units((wrong, toys[1]), compiled.append)
    assert compiled == [toys[1]]
    assert missing_units((wrong, toys[1])) == (wrong,)


def test_no_process_starts_if_no_unit_is_missing(toys, monkeypatch):
    for unit in toys:
        unit.load()
    monkeypatch.setattr(workers.subprocess, "Popen", lambda *_, **__: pytest.fail("a process was started"))
    compile_units(toys)
    assert missing_units(toys) == ()


def test_unknown_unit_function_is_refused():
    with pytest.raises(SimError, match="no_such"):
        unit_function("sim.world.plant", "no_such")
    assert "toy_kernels" not in sys.modules or hasattr(sys.modules["toy_kernels"], "force")


def test_robot_arm_run_announces_its_units_before_wiring():
    with pytest.raises(_UnitsAnnounced) as stopped:
        wire(run_config(map="robot-arm"), ready=_stop)
    assert _names(stopped.value.args[0]) == [
        "run_block", "update_reference", "robot_torque", "robot_arm_map", "follow_wrench", "_poses_along",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("config", "more"),
    [
        (run_config(), ["cylindrical_map", "follow_wrench", "_poses_along"]),
        (run_config(mode="bunny", expressive=True), ["express", "cylindrical_map", "bunny_wrench"]),
        (run_config(mode="rivers", map="rivers"), ["river_clips_map", "_derivatives", "_reference_along"]),
        (run_config(mode="lead"), ["led_map", "leading_wrench", "follow_hand", "_poses_along"]),
        (run_config(mode="stretch"), ["stretchy_wrench", "lower_start"]),
    ],
    ids=lambda value: value.mode.kind if isinstance(value, RunConfig) else "",
)
def test_run_announces_its_units_before_wiring(config: RunConfig, more: list[str]):
    with pytest.raises(_UnitsAnnounced) as stopped:
        wire(config, ready=_stop)
    names = _names(stopped.value.args[0])
    update = "update_river_reference" if config.mode.kind == "rivers" else "update_reference"
    assert names[:3] == ["run_block", update, "figure_torque"]
    assert set(more) <= set(names)


def test_modes_share_the_units_of_loop_and_figure():
    parts: list[tuple[Unit, ...]] = []
    for config in (run_config(), run_config(mode="bunny"), run_config(mode="lead")):
        with pytest.raises(_UnitsAnnounced) as stopped:
            wire(config, ready=_stop)
        parts.append(stopped.value.args[0][:3])
    assert parts[0] == parts[1] == parts[2]
