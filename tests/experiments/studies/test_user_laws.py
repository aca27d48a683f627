"""Simulated people against published laws: values within the published intervals, on panels not used for tuning."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.cli import main
from experiments.studies.user_laws import practice
from experiments.studies.user_laws.bare_device import PERIOD, End, Trace, trial
from experiments.studies.user_laws.law import Law
from experiments.studies.user_laws.report import STUDIES, TABLE, user_laws
from experiments.studies.user_laws.tracing import natural_times
from sim.errors import SimError
from sim.users.person.population import population
from sim.users.person.wishes import Wishes, following

PANELS = (1001, 1002, 1003)
"""Seeds of populations; numbers of people were chosen on those of seeds 1 to 6, 101, 201 and 202."""
PEOPLE = 6
HARDLY_VARY = ("power-law", "tremor", "step-response", "grip", "practice", "endurance")
"""Laws with so little variance that one panel of three people suffices."""


def assert_published(panels: Sequence[Sequence[Law]]) -> None:
    """The median of the panels lies within the published interval, for each number of a law."""
    for measured in zip(*panels, strict=True):
        values, law = [panel.value for panel in measured], measured[0]
        middle = float(np.median(values))
        expected = f"published {law.least:g} to {law.most:g} {law.unit}"
        assert law.least <= middle <= law.most, f"{law.name}: {np.round(values, 3)}, {expected}"


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in STUDIES if name not in HARDLY_VARY])
def test_published_law_holds_over_fresh_panels(name: str) -> None:
    panels = [user_laws(PEOPLE, seed, (name,))[0].laws for seed in PANELS[:-1]]
    # Between two values that lie in an interval the median of three does, too: the third is not needed.
    if not all(law.least <= law.value <= law.most for panel in panels for law in panel):
        panels.append(user_laws(PEOPLE, PANELS[-1], (name,))[0].laws)
        assert_published(panels)


@pytest.mark.slow
@pytest.mark.parametrize("name", HARDLY_VARY)
def test_low_variance_law_holds_on_one_fresh_panel(name: str) -> None:
    assert_published([user_laws(3, PANELS[0], (name,))[0].laws])


@pytest.mark.slow
def test_device_holds_its_load_though_a_hand_hardly_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    # Without tremor the encoders seemed frozen to the device, which let go of this person after 61 s of a load of 0.25.
    traces: list[Trace] = []

    def first_minute(*given: Any) -> Trace:
        person, wishes, _, seed, start, pushes, end = given
        traces.append(trial(person, wishes, 65.0, seed, start, pushes[: round(65.0 / PERIOD)], end))
        return traces[-1]

    monkeypatch.setattr(practice, "trial", first_minute)
    monkeypatch.setattr(practice, "LOADS", practice.LOADS[:2])
    user_laws(PEOPLE, 3003, ("endurance",))  # raises if the device lets go
    assert len(traces) == len(practice.LOADS)
    # Nobody gives way within the first minute, so each trial lasts to its end.
    assert min(trace.t[-1] for trace in traces) > 64.9


@pytest.mark.slow
def test_table_and_figures_are_not_replaced_without_overwrite(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["users", "--people", "1", "--laws", "tremor", "--out", str(tmp_path)]
    assert main(command) in (0, 1)
    assert "Tremor: frequency" in capsys.readouterr().out
    assert (tmp_path / "tremor.png").stat().st_size > 5000
    assert (tmp_path / TABLE).exists()
    assert main(command) == 2
    assert "overwrite" in capsys.readouterr().err


def test_natural_pace_of_an_ellipse_is_harmonic() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 257)
    ellipse = np.stack([0.04 * np.cos(angle), 0.02 * np.sin(angle)], axis=1)
    # Points equally spaced in arc length, so that they carry no pace.
    length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(ellipse, axis=0), axis=1))))
    even = np.interp(np.linspace(0.0, length[-1], 257), length, angle)
    points = np.stack([0.04 * np.cos(even), 0.02 * np.sin(even)], axis=1)
    np.testing.assert_allclose(natural_times(points, 2.0 * np.pi), even, atol=0.06)


def test_trial_ends_at_the_slip_and_refuses_a_device_that_lets_go() -> None:
    person, still = population(1, 1)[0], Wishes(following(np.zeros((2, 3))))
    pushes = np.zeros((3000, 3))
    pushes[500:, 0] = 8.0  # [N], under which this hand gives way
    slipped = trial(person, still, 3.0, 1, np.zeros(3), pushes, End(slip=0.02))
    assert 0.5 < slipped.t[-1] < 3.0
    assert np.linalg.norm(slipped.p[-2:], axis=1) == pytest.approx(0.02, abs=2e-3)
    assert trial(person, still, 1.0, 1, np.zeros(3), end=End(slip=0.02)).t[-1] == pytest.approx(1.0)
    pushes[500] = np.nan
    with pytest.raises(SimError, match=r"let go of a person after 0\.500 s of a trial: the field requested a force"):
        trial(person, still, 3.0, 1, np.zeros(3), pushes)
