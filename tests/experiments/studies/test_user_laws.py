"""People against published laws: each number within its published interval, for people that nothing was tuned on."""

from pathlib import Path

import pytest

from experiments.cli import main
from experiments.studies.user_laws.report import STUDIES, TABLE, user_laws

PEOPLE, SEED = 3, 8
"""Numbers of people were chosen on the population of seed 11; the docs tell which laws fresh panels miss."""


@pytest.mark.slow
@pytest.mark.parametrize("name", list(STUDIES))
def test_a_published_law_holds(name: str) -> None:
    (study,) = user_laws(PEOPLE, SEED, (name,))
    for law in study.laws:
        assert law.holds, f"{law.name}: {law.value:.3g}, published {law.least:g} to {law.most:g} {law.unit}"


@pytest.mark.slow
def test_the_table_and_its_figures_are_written_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["users", "--people", "1", "--laws", "tremor", "--out", str(tmp_path)]
    assert main(command) in (0, 1)
    assert "Tremor: frequency" in capsys.readouterr().out
    assert (tmp_path / "tremor.png").stat().st_size > 5000
    assert (tmp_path / TABLE).exists()
    assert main(command) == 2
    assert "overwrite" in capsys.readouterr().err
