"""Statistics of a study: effects, intervals, corrections, and the sentences on them."""

import numpy as np
import pytest

from experiments.trials.analysis.effect_sizes import cohen_dz, hedges_g
from experiments.trials.analysis.sentences import three_sentences, unstable_conditions
from experiments.trials.analysis.statistics import Contrast, Statistics, statistics
from experiments.trials.design.study_config import parse_study

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


@pytest.mark.slow
def test_present_effect_is_found_with_its_size_and_absent_one_is_not() -> None:
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


@pytest.mark.slow
def test_holm_correction_covers_all_contrasts() -> None:
    found = statistics(frame(-0.1), FACTORS, (), ["tracking_error", "effort"], seed=3)
    ps = sorted((c.p, c.p_holm) for c in found.contrasts)
    assert len(ps) == 4
    expected, largest = [], 0.0
    for k, (p, _) in enumerate(ps):
        largest = max(largest, min(1.0, (4 - k) * p))
        expected.append(largest)
    np.testing.assert_allclose([holm for _, holm in ps], expected, rtol=1e-9)


@pytest.mark.slow
def test_interval_coverage_with_user_specific_effects() -> None:
    covered = np.zeros(2)
    for seed in range(24):
        table = frame(-0.2, 12, seed)
        table["tracking_error"] += (table["guidance"] == "river") * np.random.default_rng(seed).normal(size=12)[
            table["user"]
        ]
        (c,) = statistics(table, {"guidance": FACTORS["guidance"]}, (), ["tracking_error"], 1).contrasts
        covered += [c.low <= -0.2 <= c.high, c.model_low <= -0.2 <= c.model_high]
    # Of 95 %, less than 19 of 24 has a chance of 1 in 1000; a bootstrap of twelve users is a little narrow. Repetitions
    # taken for users would hold it in 9 of 24.
    assert np.all(covered >= 19)


@pytest.mark.slow
def test_between_user_factor_is_compared_between_users() -> None:
    found = statistics(frame(-1.0, between=True), FACTORS, ("map",), ["tracking_error"], seed=3)
    (other,) = found.of("tracking_error", "map")
    assert other.users == 16
    assert other.agree == 0
    assert other.low < 0.0 < other.high


def test_effect_sizes_match_published_formulas() -> None:
    assert cohen_dz(np.array([1.0, 2.0, 3.0])) == pytest.approx(2.0)
    one, other = np.array([2.0, 4.0, 6.0]), np.array([1.0, 3.0, 5.0])
    assert hedges_g(one, other) == pytest.approx(0.5 * (1.0 - 3.0 / 15.0))


@pytest.mark.slow
def test_failed_trials_are_excluded_and_reported() -> None:
    table = frame(-1.0)
    table.loc[:2, "state"], table.loc[:2, "tracking_error"] = "failed", np.nan
    table.loc[:2, "reason"] = ["out of reach", "out of reach", "it broke"]
    study = parse_study(
        {"name": "s", "factors": {"guidance": {"none": {}, "river": {}}, "map": {"a": {}, "b": {}}}, "cost": "effort"},
        "",
    )
    found = statistics(table, FACTORS, (), ["tracking_error", "effort"], 1)
    sentences = three_sentences(study, found, table, 3)
    assert "of which 3 failed (out of reach, and for 1 other reason)" in sentences[0]
    assert sentences[1].startswith("Tracking error, by guidance: lower (better) with river than with none")
    assert "no difference shown between river and none" in sentences[2]


def test_interval_without_zero_is_reported_with_corrected_p() -> None:
    contrast = Contrast(
        "effort", "stiffness", "600", "50", 6, 0.4, 0.6, -0.2, -0.304, -0.188, -0.2, -0.2, -0.2, -0.3, -0.1, 0.01,
        0.057, -1.0, 6,
    )  # fmt: skip
    study = parse_study({"name": "s", "factors": {"stiffness": [50, 600]}, "cost": "effort"}, "")
    sentence = three_sentences(study, Statistics((contrast,), {}, ()), frame(-1.0), 0)[2]
    assert "no difference shown between 600 and 50" in sentence
    assert "-0.304 to -0.188 N² s; p = 0.057 corrected after Holm)" in sentence


def test_unknown_effects_are_reported_with_their_reason() -> None:
    table = frame(-1.0)
    table["effort"], table["sparc"] = 2.0, np.nan
    reasons = {
        "expressiveness": "needs a kinematic figure",
        "effort": "the same in all trials",
        "sparc": "no trial has it",
    }
    for cost, reason in reasons.items():
        study = parse_study(
            {"name": "s", "factors": {"guidance": {"none": {}, "river": {}}}, "cost": cost, "users": {"number": 1}}, ""
        )
        found = statistics(table, FACTORS, (), ["effort", "sparc"], 1)
        first, _, last = three_sentences(study, found, table, 0)
        assert reason in last
        assert first.startswith("One simulated person met 2 conditions")


def test_conditions_beyond_the_stability_boundary_are_named() -> None:
    study = parse_study(
        {"name": "s", "factors": {"guidance": {"none": {}, "river": {}}, "map": {"a": {}, "b": {}}}}, ""
    )
    table = frame(-1.0)
    assert unstable_conditions(study, table) == ()
    table["margin_used"] = np.where(table["guidance"].eq("river") & table["map"].eq("b"), 12.17, 0.04)
    (sentence,) = unstable_conditions(study, table)
    assert "than the critical one, 12.2 times with guidance river, map b. " in sentence
    table["margin_used"] = 0.04
    assert unstable_conditions(study, table) == ()


def test_two_trials_are_compared_without_an_interval() -> None:
    table = frame(-1.0)
    two = table[(table["user"] == 0) & (table["map"] == "a")].drop_duplicates("guidance")
    (river,) = statistics(two, FACTORS, (), ["tracking_error"], 1).contrasts
    assert river.users == 1
    assert np.isnan(river.low)
    assert river.difference == pytest.approx(river.mean - river.reference_mean)


@pytest.mark.slow
def test_repetitions_do_not_count_as_users() -> None:
    # Users differ in what the river does to them; then the model's interval is the paired t test's, not a narrower one.
    from scipy.stats import ttest_rel

    rng, table = np.random.default_rng(5), frame(-0.2)
    own = rng.normal(scale=0.8, size=16)
    table["tracking_error"] += (table["guidance"] == "river") * own[table["user"]]
    (river,) = statistics(table, FACTORS, (), ["tracking_error"], 1).of("tracking_error", "guidance")
    means = table.groupby(["user", "guidance"])["tracking_error"].mean().unstack()
    paired = ttest_rel(means["river"], means["none"])
    low, high = paired.confidence_interval(0.95)
    assert river.p == pytest.approx(paired.pvalue, rel=0.02)
    assert (river.model_low, river.model_high) == pytest.approx((low, high), abs=0.01)
    assert (river.low, river.high) == pytest.approx((low, high), abs=0.15)  # the bootstrap's, over the same users


@pytest.mark.parametrize("seed", [2, 4, 10])
@pytest.mark.slow
def test_model_equals_paired_t_test_for_correlated_effects(seed: int) -> None:
    from scipy.stats import ttest_rel

    table, own = frame(-0.2, users=6, seed=seed), np.random.default_rng(seed).normal(size=6)
    table["tracking_error"] += (1.0 - 0.25 * (table["guidance"] == "river")) * own[table["user"]]
    (river,) = statistics(table, FACTORS, (), ["tracking_error"], 1).of("tracking_error", "guidance")
    means = table.groupby(["user", "guidance"])["tracking_error"].mean().unstack()
    assert river.p == pytest.approx(ttest_rel(means["river"], means["none"]).pvalue, rel=0.005)


@pytest.mark.slow
def test_interaction_is_found_only_where_present() -> None:
    table = frame(-1.0)
    table["tracking_error"] += ((table["guidance"] == "river") & (table["map"] == "b")) * 0.8
    found = statistics(table, FACTORS, (), ["tracking_error", "effort"], 1).interactions
    assert found["tracking_error"] < 1e-4
    assert found["effort"] > 0.05
    between = statistics(frame(-1.0, between=True), FACTORS, ("map",), ["tracking_error"], 1).interactions
    assert between["tracking_error"] > 0.05


@pytest.mark.slow
def test_failed_condition_does_not_bias_the_other_level() -> None:
    # Map b is 5 mm worse; users whose trials of it with the river failed must not bias the effect of the river.
    table = frame(0.0)
    table["tracking_error"] += 5.0 * (table["map"] == "b")
    lost = (table["user"] < 8) & (table["map"] == "b") & (table["guidance"] == "river")
    table.loc[lost, ["state", "tracking_error"]] = ["failed", np.nan]
    (river,) = statistics(table, FACTORS, (), ["tracking_error"], 1).of("tracking_error", "guidance")
    assert abs(river.difference) < 0.3


@pytest.mark.slow
def test_factor_name_may_equal_a_formula_function() -> None:
    table, renamed = frame(-1.0), frame(-1.0).rename(columns={"map": "C"})
    (found,) = statistics(table, FACTORS, (), ["tracking_error"], 1).of("tracking_error", "guidance")
    factors = {"guidance": FACTORS["guidance"], "C": FACTORS["map"]}
    (same,) = statistics(renamed, factors, (), ["tracking_error"], 1).of("tracking_error", "guidance")
    assert same == found
