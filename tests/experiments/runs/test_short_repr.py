"""`repr` of a simulation and its parts: short, without addresses, clips and functions by name."""

import numpy as np
import pytest

import hvf
from controllers.certificates.report import Verdict
from experiments.runs.simulation import Tick

CURVE = hvf.circle()
FIELD = hvf.Follow(CURVE, k_r=300, b_d=8)
CLIPS = hvf.clips("squat_dance", "cheer", "angry", "spin")


@hvf.law
def floor(hand, k=500.0):
    return (0, 0, -k * hand.p[2])


def towards(t, place, force):
    return np.zeros(3)


class Bow(hvf.HapticMap):
    def pose(self, x, memory=None):
        return hvf.rest_pose()


FOUR = hvf.Cylindrical(CLIPS, around=CURVE)
PERSONAL = hvf.User(person=hvf.persona("novice"), intent=hvf.intents.Own(towards))
SHOWN = [
    (FOUR, "Cylindrical(clips=['squat_dance', 'cheer', 'angry', 'spin'])"),
    (hvf.Composite(CLIPS[:1], around=CURVE, reach=0.02), "Composite(clips=['squat_dance'], reach=0.02)"),
    (hvf.User(), "User()"),
    (PERSONAL, "intent=Own(function=towards)"),
    (hvf.User(person=hvf.population(3, seed=1)[1]), "…"),
    (hvf.Simulation(field=FIELD, haptic_map=FOUR), "k_r=300, b_d=8"),
    (hvf.Simulation(field=(FIELD + floor).limited(8.0), haptic_map=FOUR, user=PERSONAL), "<field of Follow, floor>"),
    (hvf.Simulation(field=FIELD, haptic_map=Bow(), seed=3, figure=hvf.Figure(kind="none")), "haptic_map=<Bow>"),
]


@pytest.mark.parametrize(("part", "text"), SHOWN, ids=lambda value: type(value).__name__)
def test_repr_is_short_and_without_addresses(part: object, text: str) -> None:
    assert text in repr(part)
    assert len(repr(part)) <= 250, repr(part)
    assert "0x" not in repr(part)


def test_repr_shows_non_default_values() -> None:
    sim = hvf.Simulation(field=FIELD, haptic_map=Bow(), seed=3, figure=hvf.Figure(kind="none"))
    assert repr(sim).endswith("haptic_map=<Bow>, figure=Figure(kind='none'), seed=3)")


def test_repr_of_a_tick_tells_time_tip_and_force() -> None:
    hand = hvf.HandState(0.005, np.array([0.0477, 1e-3, 0.0]), np.eye(4)[0], np.zeros(3), np.zeros(3))
    wrench, pose = hvf.Wrench(np.array([0.0, 0.3, 0.4]), np.zeros(3)), hvf.rest_pose()
    tick = Tick(hand, wrench, wrench.force, pose, pose)
    assert repr(tick) == "<tick at 0.005 s: tip at (47.7, 1.0, 0.0) mm, force 0.50 N>"


def test_verdict_prints_as_outcome_and_reason() -> None:
    assert str(Verdict("certified", "stable: …", 3.0, ("linear",))) == "certified: stable: …"
