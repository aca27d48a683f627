"""An audit of figures of speed: each keeps to a ratio, says so, and counts."""

import json
import subprocess
import sys

import pytest

from experiments.bench.figures import Figure, print_figures
from experiments.bench.tick_cost import MODES

FIGURES = (
    Figure("a tick", 1.4, "mj_steps", at_most=1.5),
    Figure("threads", 0.8, at_least=0.9),
    Figure("told", 3.0),
)


def test_each_figure_says_whether_it_passes_and_a_check_fails_with_one_that_fails(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert [figure.passes for figure in FIGURES] == [True, False, None]
    assert print_figures(FIGURES, False, True) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "pass  a tick: 1.4 mj_steps (≤ 1.5)"
    assert lines[1] == "FAIL  threads: 0.8 (≥ 0.9)"
    assert lines[2] == "      told: 3"
    assert lines[3] == "1 of 3 figures fail: threads"
    assert print_figures(FIGURES, False, False) == 0
    assert print_figures((FIGURES[0], FIGURES[2]), False, True) == 0


def test_what_is_not_a_number_passes_nothing() -> None:
    assert Figure("nothing", float("nan"), at_most=1.0).passes is False
    assert Figure("nothing", float("nan"), at_least=1.0).passes is False


def test_json_has_values_bounds_and_verdicts(capsys: pytest.CaptureFixture[str]) -> None:
    assert print_figures(FIGURES, True, True) == 1
    told = json.loads(capsys.readouterr().out)
    assert [one["passes"] for one in told] == [True, False, None]
    assert told[0] == {
        "name": "a tick", "value": 1.4, "unit": "mj_steps", "at_most": 1.5, "at_least": None, "passes": True,
    }  # fmt: skip


@pytest.mark.parametrize("name", MODES)
def test_every_mode_that_is_benched_steps_once_a_tick_and_has_its_figure_at_500_hz(name: str) -> None:
    config = MODES[name]()
    assert config.scene.substeps() == 1
    assert config.figure.figure_ticks * config.clock.servo_period == pytest.approx(2e-3)
    assert config.figure.kind == "physical"


@pytest.mark.slow
def test_what_draws_is_not_imported_before_the_first_tick() -> None:
    late = ("matplotlib", "viser", "mjviser", "trimesh", "casadi", "pandas", "statsmodels", "optuna", "dask", "PIL")
    code = (
        "import sys, experiments.cli, experiments.runs.run, experiments.setups.wiring; "
        f"print([name for name in {late} if name in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert told.strip() == "[]"
