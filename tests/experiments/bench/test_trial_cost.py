"""What `hvf bench` says of studies, in small: that its rows are measured, not how fast this machine is."""

import pytest
from rich.console import Console

from experiments.bench.trial_cost import grown, overhead, start_seconds

QUIET = Console(quiet=True)


def test_what_a_study_costs_beside_its_trials_is_little_and_more_than_nothing() -> None:
    more, seconds = overhead(1, 1.0, QUIET)
    assert 0.0 < more < 1.0  # of trials a fifth as long as those of the bench, whose bound is 0.05
    assert seconds > 0.0


def test_memory_after_short_trials_is_told() -> None:
    assert 0.5 < grown(40, QUIET) < 1.5


@pytest.mark.slow
def test_a_new_process_tells_when_its_first_row_is_there() -> None:
    assert start_seconds() > 0.0
