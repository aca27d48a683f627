"""The page of a tuning: candidates at whole numbers, and reasons of verdicts in lines that fit the window."""

import pytest

pytest.importorskip("optuna")

from experiments.tuning.page import objectives_figure, tuning_page
from experiments.tuning.search import Candidate
from tests.experiments.tuning.test_tuning import tuning


def test_few_candidates_are_numbered_and_long_reasons_wrap() -> None:
    found = [Candidate({"stiffness": 300.0}, (cost,), "certified", 2.0, "tried") for cost in (0.3, 0.1, 0.2)]
    figure = objectives_figure(tuning(), found, found[1])
    assert all(float(tick).is_integer() for tick in figure.axes[0].get_xticks())
    page = tuning_page(tuning(), "", [], [], [], {}, [figure], {"passivity": "a long reason"})
    assert "<td class=says>a long reason</td>" in page
