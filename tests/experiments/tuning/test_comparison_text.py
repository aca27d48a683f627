"""The sentence on tuned values where too few users judge them."""

from math import nan
from pathlib import Path

from experiments.studies.tuning_trials import lines
from experiments.tuning.search import Candidate
from experiments.tuning.tune_config import TuneConfig
from experiments.tuning.tuning import Comparison, Tuned, _sentence

CHOSEN = Candidate({"stiffness": 70.0}, (0.22,), "certified", 1.5, "tried")


def test_comparison_of_two_users_states_that_there_is_no_interval() -> None:
    config = TuneConfig(name="x", objectives=("tracking_error",), space={"stiffness": {"low": 50.0, "high": 100.0}})  # pyright: ignore
    sentence = _sentence(config, Comparison("defaults", "tracking_error", 0.44, 0.22, 0.22, nan, nan))
    assert "better by 0.22 (no difference is shown: an interval takes three users or more" in sentence
    assert "nan" not in sentence
    known = _sentence(config, Comparison("defaults", "tracking_error", 0.44, 0.22, 0.22, 0.1, 0.3))
    assert "(95 % interval of what is gained 0.1 to 0.3)." in known


def test_interval_over_replications_takes_two_of_them() -> None:
    def tuned(low: float, high: float) -> Tuned:
        compared = (Comparison("defaults", "tracking_error", 0.44, 0.22, 0.22, low, high),)
        return Tuned(Path("1"), CHOSEN.values, (CHOSEN,), compared, {}, ())

    one = lines([tuned(0.1, 0.3)])[1]
    assert one == "tracking_error against defaults, one replication: better by 0.22 (0.1 to 0.3)"
    assert lines([tuned(nan, nan)])[1].endswith("better by 0.22")
    two = lines([tuned(0.1, 0.3), tuned(nan, nan)])[2]
    assert "better by 0.22 (95 % interval 0.22 to 0.22 over 2 replications)" in two
    assert two.endswith(": 0.22 (0.1 to 0.3), 0.22")
