"""`hvf.certify`: the verdict is on the very field of a simulation, its governor and own laws included."""

import numpy as np
import pytest

import hvf
from controllers.certificates.loop.hand import NO_HANDS
from controllers.certificates.report import Verdict, without_laws
from controllers.curves.trajectory import Trajectory
from controllers.fields.follow import Follow
from controllers.fields.governor import Governor
from controllers.fields.stretchy_tubes import StretchyTubes
from models.mocap.library import embedded

CIRCLE = Trajectory.circle(0.0477, 4.0)


def simulation(field):
    clips = [embedded("walk")]
    return hvf.Simulation(field=field, haptic_map=hvf.Cylindrical(clips, around=CIRCLE), figure=hvf.Figure(kind="none"))


@pytest.mark.slow
def test_verdict_includes_the_governor_of_the_simulation():
    speeds = np.tile([0.1, 0.2], (8, 1))
    field = Follow(CIRCLE, 300.0, 8.0, 0.25)
    plain, soft, hard = (
        hvf.certify(simulation(law), NO_HANDS)
        for law in (field, field + Governor(CIRCLE, speeds, 8.0), field + Governor(CIRCLE, speeds, 200.0))
    )
    assert [certificate.stability.verdict for certificate in (plain, soft, hard)] == [
        "certified",
        "certified",
        "refuted",
    ]
    assert len({plain.inputs_hash, soft.inputs_hash, hard.inputs_hash}) == 3


@pytest.mark.slow
def test_uncovered_law_is_unknown_and_named():
    tubes = StretchyTubes(CIRCLE, 150.0, 150.0, 14.0)
    found = hvf.certify(simulation(tubes), NO_HANDS).stability
    assert found.verdict == "unknown"
    assert "StretchyTubes" in found.reason
    assert "no oscillation grows at" in found.reason
    certified = Verdict("certified", "stable", 1.0)
    assert without_laws(certified, ["walls", "gates"]).reason == "left out: walls and gates; without: stable"
    assert without_laws(Verdict("refuted", "no", None, (), {"p": 1}), ["walls"]).verdict == "refuted"


CURVE = hvf.circle(lap=2.0)


def cheer_simulation(field: hvf.Law) -> hvf.Simulation:
    return hvf.Simulation(field=field, haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=CURVE))


@hvf.law
def level(hand, k=50.0):
    return (0.0, 0.0, -k * hand.p[2])


@pytest.mark.slow
def test_certificate_covers_the_composed_field() -> None:
    alone = hvf.certify(cheer_simulation(hvf.Follow(CURVE, k_r=300, b_d=8)))
    composed = hvf.certify(cheer_simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0)))
    stiff = hvf.certify(cheer_simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + level(k=60000.0)))
    assert (alone.stability.verdict, composed.stability.verdict) == ("certified", "certified")
    assert any("8 N" in assumed for assumed in composed.stability.assumptions)
    # 60 N/mm are far above the critical stiffness of the loop, though FOLLOW's own gain is low.
    assert stiff.stability.verdict == "refuted"
    assert len({c.inputs_hash for c in (alone, composed, stiff)}) == 3


@hvf.law
def soft_floor(hand, k=500.0):
    return 0.0, 0.0, k * hand.p[2] ** 2 if hand.p[2] < 0 else 0.0


@pytest.mark.slow
def test_nonlinear_or_gated_law_is_unknown_and_named() -> None:
    curved = hvf.certify(cheer_simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + soft_floor)).stability
    gated = hvf.certify(
        cheer_simulation(hvf.Follow(CURVE, k_r=300, b_d=8).gated(hvf.Weight.ball((0, 0, 0), 1.0)))
    ).stability
    assert (curved.verdict, gated.verdict) == ("unknown", "unknown")
    assert "law soft_floor" in curved.reason
    assert "has cases whose force is not linear" in curved.reason
    assert "gated" in gated.reason


@hvf.law
def of_time(hand, k=1e6):
    return k * hand.t * hand.p[0], 0.0, 0.0


@hvf.law
def of_orientation(hand, k=10.0):
    return k * hand.q[1] * hand.p[0], k * hand.w[2], 0.0


@hvf.law
def of_switch(hand, k=1e6):
    return k * hand.switch * hand.p[0], 0.0, 0.0


@hvf.law
def with_moment(hand, k=100.0):
    return -k * hand.p[0], 0.0, 0.0, -0.1 * hand.w[0], 0.0, 0.0


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (of_time, "depends on the time of the hand"),
        (of_orientation, "depends on the orientation and the angular velocity of the hand"),
        (of_switch, "depends on the switch of the hand"),
    ],
)
def test_law_of_time_orientation_or_switch_is_not_certified(law: hvf.Law, message: str) -> None:
    found = hvf.certify(cheer_simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + law), NO_HANDS)
    assert found.stability.verdict in ("unknown", "refuted")
    assert f"the force of law {law.name} " in found.stability.reason
    assert message in found.stability.reason
    assert found.passivity.verdict == "unknown"


def test_moment_of_own_law_is_listed_as_an_assumption() -> None:
    stability = hvf.certify(cheer_simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + with_moment), NO_HANDS).stability
    assert stability.verdict == "certified"
    assert any("moment on the stylus has no effect" in assumed for assumed in stability.assumptions)
