"""The verdict beside a gain's slider equals the certificate."""

import pytest

from controllers.certificates.loop.governed import governed_stability
from controllers.certificates.loop.hand import HandRange
from experiments.certify.certify import certified_rivers
from experiments.config.options import run_config
from experiments.live.panels.gains_panel import verdict_html
from experiments.live.session.gain_verdict import gain_verdicts
from experiments.setups.certified_law import governor_drag


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        {}, {"stiffness": 9000.0}, {"mode": "bunny", "stiffness": 6000.0},
        {"governor": True}, {"governor": True, "governor_drag": 30.0}, {"governor": True, "governor_drag": 200.0},
    ],
)  # fmt: skip
def test_gain_verdict_equals_the_certificate(words):
    config = run_config(**words)
    (river,) = certified_rivers(config).values()
    whole = governed_stability(river, governor_drag(config), HandRange().hands())
    (found,) = gain_verdicts(config)
    assert (found.stability.verdict, found.stability.margin) == (whole.verdict, whole.margin)


@pytest.mark.slow
def test_unstable_gain_is_red_with_a_reason():
    (found,) = gain_verdicts(run_config(stiffness=11000.0))
    assert found.stability.verdict == "refuted"
    assert "k_r = 11000 N/m" in found.stability.reason
    html = verdict_html((found,), False)
    assert "unstable" in html
    assert "#c02020" in html


@pytest.mark.slow
def test_uncertified_configuration_is_unknown_with_a_reason():
    for words, message in (
        ({"mode": "lead"}, "led"),
        ({"mode": "rivers", "map": "rivers", "governor": True}, "--governor"),
        ({"walls": True}, "--walls"),
    ):
        (found,) = gain_verdicts(run_config(**words))
        assert found.stability.verdict == "unknown"
        assert message in found.stability.reason
    assert "checking" in verdict_html((), True)
