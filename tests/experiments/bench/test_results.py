"""Results of `hvf bench`: bounds, verdicts, exit code, JSON, and the configurations of the benchmarked modes."""

import json

import pytest

from experiments.bench.results import BenchmarkResult, print_results
from experiments.bench.tick_cost import MODES

RESULTS = (
    BenchmarkResult("a tick", 1.4, "mj_steps", at_most=1.5),
    BenchmarkResult("threads", 0.8, at_least=0.9),
    BenchmarkResult("told", 3.0),
)


def test_check_prints_verdicts_and_fails_if_any_benchmark_fails(capsys: pytest.CaptureFixture[str]) -> None:
    assert [result.passes for result in RESULTS] == [True, False, None]
    assert print_results(RESULTS, False, True) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "pass  a tick: 1.4 mj_steps (≤ 1.5)"
    assert lines[1] == "FAIL  threads: 0.8 (≥ 0.9)"
    assert lines[2] == "      told: 3"
    assert lines[3] == "1 of 3 benchmarks fail: threads"
    assert print_results(RESULTS, False, False) == 0
    assert print_results((RESULTS[0], RESULTS[2]), False, True) == 0


def test_nan_fails_upper_and_lower_bounds() -> None:
    assert BenchmarkResult("nothing", float("nan"), at_most=1.0).passes is False
    assert BenchmarkResult("nothing", float("nan"), at_least=1.0).passes is False


def test_json_output_has_values_bounds_and_verdicts(capsys: pytest.CaptureFixture[str]) -> None:
    assert print_results(RESULTS, True, True) == 1
    result = json.loads(capsys.readouterr().out)
    assert [one["passes"] for one in result] == [True, False, None]
    assert result[0] == {
        "name": "a tick", "value": 1.4, "unit": "mj_steps", "at_most": 1.5, "at_least": None, "passes": True,
    }  # fmt: skip


@pytest.mark.parametrize("name", MODES)
def test_benchmarked_modes_step_physics_once_per_tick_and_figure_at_500_hz(name: str) -> None:
    config = MODES[name]()
    assert config.scene.substeps() == 1
    assert config.figure.figure_ticks * config.clock.servo_period == pytest.approx(2e-3)
    assert config.figure.kind == "physical"
