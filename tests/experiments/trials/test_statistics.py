import numpy as np
import pytest

from experiments.trials.analysis.sentences import three_sentences
from experiments.trials.analysis.statistics import cohen_dz, hedges_g, statistics
from experiments.trials.study_config import study_from

pd = pytest.importorskip("pandas")
pytest.importorskip("statsmodels")

FACTORS = {"guidance": ("none", "river"), "map": ("a", "b")}


def frame(effect: float, users: int = 16, seed: int = 1, between: bool = False):
    rng, rows = np.random.default_rng(seed), []
    for user in range(users):
        own = rng.normal(scale=0.5)
        for guidance in FACTORS["guidance"]:
            for k, map_name in enumerate(FACTORS["map"]):
                if between and user % 2 != k:
                    continue
                for repetition in range(3):
                    value = 3.0 + own + effect * (guidance == "river") + rng.normal(scale=0.3)
                    rows.append(
                        {"user": user, "guidance": guidance, "map": map_name, "repetition": repetition}
                        | {"state": "done", "reason": "", "tracking_error": value, "effort": rng.normal()}
                    )
    return pd.DataFrame(rows)


def test_an_effect_that_is_there_is_found_with_its_size_and_one_that_is_not_is_not() -> None:
    found = statistics(frame(-1.0), FACTORS, (), ["tracking_error", "effort"], seed=3)
    (river,) = found.of("tracking_error", "guidance")
    assert river.low < -1.0 < river.high
    assert river.high - river.low < 0.3
    assert river.model == pytest.approx(river.difference, abs=1e-6)  # a balanced design
    assert river.p_holm < 1e-6
    assert river.agree == 16
    (other,) = found.of("tracking_error", "map")
    assert other.low < 0.0 < other.high
    assert found.of("effort", "guidance")[0].p_holm > 0.05


def test_holm_s_correction_is_over_all_contrasts_and_never_makes_one_smaller() -> None:
    found = statistics(frame(-0.1), FACTORS, (), ["tracking_error", "effort"], seed=3)
    ps = sorted((c.p, c.p_holm) for c in found.contrasts)
    assert len(ps) == 4
    expected, largest = [], 0.0
    for k, (p, _) in enumerate(ps):
        largest = max(largest, min(1.0, (4 - k) * p))
        expected.append(largest)
    np.testing.assert_allclose([holm for _, holm in ps], expected, rtol=1e-9)


@pytest.mark.slow
def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    held = 0
    for seed in range(40):
        (river,) = statistics(frame(-0.2, 10, seed), FACTORS, (), ["tracking_error"], 1).of(
            "tracking_error", "guidance"
        )
        held += river.low <= -0.2 <= river.high
    assert held >= 33  # of 95 %, less than that has a chance of 1 in 2000; a bootstrap of ten users is a little narrow


def test_a_factor_between_users_is_compared_between_them() -> None:
    found = statistics(frame(-1.0, between=True), FACTORS, ("map",), ["tracking_error"], seed=3)
    (other,) = found.of("tracking_error", "map")
    assert other.users == 16
    assert other.agree == 0
    assert other.low < 0.0 < other.high


def test_effect_sizes_are_the_published_ones() -> None:
    assert cohen_dz(np.array([1.0, 2.0, 3.0])) == pytest.approx(2.0)
    one, other = np.array([2.0, 4.0, 6.0]), np.array([1.0, 3.0, 5.0])
    assert hedges_g(one, other) == pytest.approx(0.5 * (1.0 - 3.0 / 15.0))


def test_failed_trials_are_left_out_and_told() -> None:
    made = frame(-1.0)
    made.loc[0, ["state", "tracking_error"]] = ["failed", np.nan]
    study = study_from(
        {"name": "s", "factors": {"guidance": {"none": {}, "river": {}}, "map": {"a": {}, "b": {}}}, "cost": "effort"},
        "",
    )
    found = statistics(made, FACTORS, (), ["tracking_error", "effort"], 1)
    said = three_sentences(study, found, len(made), 1)
    assert "of which 1 failed" in said[0]
    assert said[1].startswith("Tracking error, by guidance: lower (better) with river than with none")
    assert "no difference shown between river and none" in said[2]
