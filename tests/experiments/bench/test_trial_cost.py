"""Cost of studies in `hvf bench`, on small studies: values are measured, the speed of this machine is not judged."""

import pytest
from rich.console import Console

from experiments.bench.trial_cost import grown, overhead, start_seconds

QUIET = Console(quiet=True)


def test_study_overhead_is_positive_and_below_its_trials() -> None:
    more, seconds = overhead(1, 1.0, QUIET)
    assert 0.0 < more < 1.0  # trials a fifth as long as in `hvf bench`, where the bound is 0.05
    assert seconds > 0.0


@pytest.mark.slow
def test_memory_growth_over_trials_is_measured() -> None:
    assert 0.5 < grown(40, QUIET) < 1.5


@pytest.mark.slow
def test_start_time_of_a_new_process_is_measured() -> None:
    assert start_seconds() > 0.0
