"""Every intent, carried out by a simulated person in the whole loop: the motion shows what was intended."""

from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import hvf
from experiments.config.options import run_config
from experiments.results.measures.summary import RunSummary
from experiments.runs.run import record
from experiments.setups.wiring import wire
from sim.users.intents.intent import PersonIntent

RADIUS, LAP = 0.0477, 4.0
CURVE = hvf.circle(radius=RADIUS, lap=LAP)
STRONG, LIGHT = (150.0, 8.0), (20.0, 2.0)  # k_r [N/m] and b_d [N s/m] of strong and of light guidance


def channels_of(
    intent: PersonIntent, seconds: float, river: tuple[float, float] = LIGHT, seed: int = 3
) -> dict[str, np.ndarray]:
    """Channels of the ticks of a person who does something on a circle with FOLLOW, without a figure."""
    sim = hvf.Simulation(
        field=hvf.Follow(CURVE, k_r=river[0], b_d=river[1]),
        haptic_map=hvf.Cylindrical(hvf.clips("squat_dance"), around=CURVE),
        user=hvf.User(person=hvf.persona("median"), intent=intent), figure=hvf.Figure(kind="none"), seed=seed,
    )  # fmt: skip
    run = sim.run(seconds)
    return {name: run.ticks[name] for name in ("t", "p", "v", "user", "force", "distance")}


def within(found: dict[str, np.ndarray], name: str, start: float, end: float) -> np.ndarray:
    """A channel between two times [s]."""
    return found[name][(found["t"] >= start) & (found["t"] < end)]


def radius(found: dict[str, np.ndarray], start: float, end: float) -> np.ndarray:
    return np.hypot(*within(found, "p", start, end)[:, :2].T)


def angle_gone(found: dict[str, np.ndarray], start: float, end: float) -> float:
    """Angle about the circle's middle [laps]."""
    p = within(found, "p", start, end)
    return float(np.ptp(np.unwrap(np.arctan2(p[:, 1], p[:, 0])))) / (2.0 * np.pi)


def test_relaxed_hand_is_led_along_the_curve() -> None:
    """The damper of FOLLOW (8 N s/m) moves a slack arm of about 7 N s/m."""
    found = channels_of(hvf.intents.Relax(), 5.0, STRONG)
    assert angle_gone(found, 1.0, 5.0) > 0.4
    assert np.median(within(found, "distance", 1.0, 5.0)) < 4e-3
    assert np.sum(within(found, "force", 1.0, 5.0) * within(found, "v", 1.0, 5.0)) > 0.0  # positive work


def test_tracing_person_follows_the_curve_unguided() -> None:
    found = channels_of(hvf.intents.Trace(), 5.0, (0.0, 0.0))
    assert 0.9 < angle_gone(found, 1.0, 5.0) < 1.1
    assert np.median(within(found, "distance", 1.0, 5.0)) < 3e-3


def test_exaggerating_person_enlarges_and_reduces_the_radius() -> None:
    found = channels_of(hvf.intents.Exaggerate(larger=1.3, calmer=0.7), 8.0)
    assert np.median(radius(found, 4.7, 5.3)) > 1.15 * RADIUS
    assert np.median(radius(found, 6.7, 7.3)) < 0.85 * RADIUS


def test_corner_cutting_person_leaves_the_curve_only_there() -> None:
    found = channels_of(hvf.intents.CutCorner(0.25, 0.5), 8.0)
    chord = RADIUS * np.cos(np.pi / 4.0)
    assert np.min(radius(found, 5.0, 6.0)) < 0.5 * (chord + RADIUS)
    assert np.median(radius(found, 6.5, 7.8)) > 0.93 * RADIUS


def test_changing_person_ends_on_the_other_curve() -> None:
    found = channels_of(hvf.intents.ChangeOver(hvf.circle(radius=0.06, lap=LAP), at=2.0), 6.0)
    assert np.median(radius(found, 1.0, 2.0)) < 0.052
    assert np.median(radius(found, 4.5, 6.0)) > 0.056


@pytest.mark.slow
def test_resisting_person_stops_and_continues() -> None:
    found = channels_of(hvf.intents.Resist(at=1.5, seconds=2.0), 6.0, (60.0, 4.0))
    stayed = within(found, "p", 2.0, 3.5)
    assert np.max(np.linalg.norm(stayed - stayed.mean(axis=0), axis=1)) < 0.015
    assert angle_gone(found, 4.0, 6.0) > 0.25


@pytest.mark.slow
def test_lost_person_leaves_the_curve_and_returns() -> None:
    found = [channels_of(hvf.intents.GetLost(at=1.0, seconds=3.0, away=0.015), 7.0, seed=seed) for seed in (3, 4, 5)]
    assert min(np.max(within(one, "distance", 1.5, 3.5)) for one in found) > 8e-3
    # 0.9 to 2.9 mm by the seed; eight were tried.
    assert np.median([np.median(within(one, "distance", 5.5, 7.0)) for one in found]) < 4e-3


def test_pressing_person_pushes_outward_in_time() -> None:
    found = channels_of(hvf.intents.Press([hvf.Push(2.0, 1.0, 2.0)]), 5.0, STRONG)
    outward = found["p"][:, :2] / np.linalg.norm(found["p"][:, :2], axis=1, keepdims=True)
    pushed = np.sum(found["user"][:, :2] * outward, axis=1)
    pushing = (found["t"] > 2.3) & (found["t"] < 2.9)
    assert np.mean(pushed[pushing]) > np.mean(pushed[found["t"] < 2.0]) + 0.5
    assert np.max(radius(found, 2.0, 3.2)) > RADIUS + 3e-3


def test_own_intent_runs_in_python_and_compiled() -> None:
    def smaller(t, place, force):
        c, s = 0.03 * np.cos(t), 0.03 * np.sin(t)
        return hvf.intents.Wish([c, s, 0.0], velocity=[-s, c, 0.0])

    def still(t, place, force, rows):
        rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 9] = 0.03, 0.0, 0.01, 1.0

    assert np.median(radius(channels_of(hvf.intents.Own(smaller), 4.0), 2.0, 4.0)) == pytest.approx(0.03, abs=4e-3)
    held = within(channels_of(hvf.intents.Own(still, compiled=True), 3.0), "p", 2.0, 3.0)
    assert np.linalg.norm(np.median(held, axis=0) - [0.03, 0.0, 0.01]) < 8e-3


def summary_of(folder: Path, **words: object) -> RunSummary:
    folder.mkdir(exist_ok=True)
    session = wire(run_config(**words))  # pyright: ignore[reportArgumentType]
    return record(session, folder, {}, float(str(words["seconds"])), 0.0, Console(quiet=True))


@pytest.mark.slow
def test_bending_person_holds_and_drags_the_tube(tmp_path: Path) -> None:
    dragged = []
    for seed in (1, 2, 3):
        editing = summary_of(tmp_path / str(seed), mode="stretch", map="composite", clips=("squat_dance",), seed=seed,
                             person="median", figure="kinematic", seconds=6.0).editing  # fmt: skip
        assert editing is not None
        held = [press.dragged_mm for press in editing.presses if press.what == "held"]
        assert held
        dragged.append(max(held))
    # 8 to 35 mm by the seed.
    assert np.median(dragged) > 5.0


@pytest.mark.slow
def test_leading_person_moves_the_figure_along_a_path(tmp_path: Path) -> None:
    lead = summary_of(tmp_path, mode="lead", person="median", figure="kinematic", seconds=8.0).lead
    assert lead is not None
    assert lead.length_m > 2.0
    assert lead.slide_cm < 3.0  # the bound for every led figure
    assert "physical" not in " ".join(lead.lines())
