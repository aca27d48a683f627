"""Verdicts on turns, starts and stops, against a mass on a foot in MuJoCo."""

import numpy as np
import pytest

from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA
from experiments.flights.ballistics import clip_ballistics
from experiments.studies.turn_trials import follow, parabola, trial
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "pace"), [("run", 1.5), ("ginga", 2.3)])
def test_refuted_turns_are_missed_and_feasible_ones_followed(name, pace):
    clip = embedded(name)
    played = clip_ballistics(Clip(clip.poses, pace * clip.fps, name))
    verdict = played.certificate.verdicts["turns"]
    assert verdict.verdict == "refuted"
    example = verdict.counterexample
    outcome = trial(played.motion, example, DEFAULT_CRITERIA.friction)
    assert outcome.onset == pytest.approx(outcome.rate, rel=0.005)
    assert min(outcome.miss, outcome.miss_of_mean) > outcome.bound > 3e-3
    seconds = (example["end"] - example["start"]) / played.motion.fps
    assert (
        parabola(example["acceleration"], seconds, DEFAULT_CRITERIA.friction, 0.98 * outcome.rate).miss
        < 0.1 * outcome.bound
    )


def test_only_friction_limits_the_followed_motion():
    t = np.linspace(0.0, 0.2, 25)[:, None]
    start = 0.5 * np.array([14.0, 0.0, 0.0]) * t**2
    slippery, rough = (follow(start, 120.0, np.zeros(3), friction) for friction in (0.75, 1.6))
    assert slippery.slid > 0.1
    assert rough.slid < 5e-3
    assert rough.miss < 0.05 * slippery.miss
    # A slipping foot is pushed by the friction force only, whatever the motors do.
    assert slippery.miss == pytest.approx(0.5 * (14.0 - 0.75 * 9.81) * 0.2**2, rel=0.1)
