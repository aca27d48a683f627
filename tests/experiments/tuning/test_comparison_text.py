"""The sentence on tuned values where too few users judge them."""

from math import nan

from experiments.tuning.tune_config import TuneConfig
from experiments.tuning.tuning import Comparison, _sentence


def test_comparison_of_two_users_states_that_there_is_no_interval() -> None:
    config = TuneConfig(name="x", objectives=("tracking_error",), space={"stiffness": {"low": 50.0, "high": 100.0}})  # pyright: ignore
    sentence = _sentence(config, Comparison("defaults", "tracking_error", 0.44, 0.22, 0.22, nan, nan))
    assert "better by 0.22 (no difference is shown: an interval takes three users or more" in sentence
    assert "nan" not in sentence
    known = _sentence(config, Comparison("defaults", "tracking_error", 0.44, 0.22, 0.22, 0.1, 0.3))
    assert "(95 % interval of what is gained 0.1 to 0.3)." in known
