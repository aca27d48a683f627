"""Verdicts on stability against simulated hands: certified loops never oscillate, refuted ones do."""

import re
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

import hvf
from controllers.certificates.loop.governed import governed_stability
from controllers.certificates.loop.hand import NO_HANDS, HandImpedance
from controllers.certificates.loop.laws import BUNNY_LAW, SEEK_LAW
from controllers.certificates.loop.sampling import Sampling
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.governor import Governor
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.fields.stretchy_tubes import StretchyTubes
from experiments.certify.trial_simulation import LAP_DURATION, Conditions, LoopTrial, simulate
from experiments.cli import main
from tests.controllers.rivers_for_certificates import CIRCLE, river
from tests.experiments.certify.test_certified_simulation import simulation

TRIAL_CURVE = Trajectory.circle(0.0477, LAP_DURATION)


# Without encoder rounding, which would add spurious accelerations to the path.
WITH_FRICTION = Conditions(8, mujoco.mjtIntegrator.mjINT_IMPLICITFAST, coulomb=True)


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
def test_command_refutes_a_run_that_oscillates(tmp_path):
    field = ["--clips", "backflip", "--governor", "--governor-drag", "200"]
    assert main(["certify", *field, "--no-hand", "--json", "--out", str(tmp_path / "governed")]) == 0
    text = (tmp_path / "governed" / "certificate.json").read_text()
    assert re.search(r'"stability": \{\s*"verdict": "refuted"', text)
    assert main(["run", *field, "--figure", "none", "--seconds", "3", "--out", str(tmp_path / "run")]) == 0
    assert '"since": null' not in (tmp_path / "run" / "summary.json").read_text()


@dataclass(frozen=True)
class LawTrial(LoopTrial):
    """A trial with any law."""

    law: Law

    def program(self, k_r):
        return self.law.program()


def _push_away(hand):
    return (2000.0 * hand.p[0] - 100.0 * hand.v[0], -100.0 * hand.v[1], -100.0 * hand.v[2])


def _soft(hand):
    return (-20.0 * hand.p[0], -20.0 * hand.p[1], -20.0 * hand.p[2])


SPEEDS = np.tile([0.05, 0.1], (8, 1))
LAWS = {
    "follow": (Follow(TRIAL_CURVE, 300.0, 8.0, 0.25), lambda: governed_stability(river(), 0.0, [HandImpedance()])),
    "follow, too stiff": (
        Follow(TRIAL_CURVE, 12_000.0, 8.0, 0.25),
        lambda: governed_stability(river(k_r=12_000.0), 0.0, [HandImpedance()]),
    ),
    "bunny": (
        Bunny(TRIAL_CURVE, 300.0, 8.0, 0.05, pace="wait"),
        lambda: governed_stability(river(BUNNY_LAW, width=0.05), 0.0, [HandImpedance()]),
    ),
    "seek": (
        StretchyTubes(TRIAL_CURVE, 150.0, 150.0, 14.0, width=TRIAL_CURVE.duration / 8.0),
        lambda: governed_stability(river(SEEK_LAW, 150.0, 14.0, np.inf), 0.0, [HandImpedance()]),
    ),
    "seek, too damped": (
        StretchyTubes(TRIAL_CURVE, 150.0, 150.0, 120.0, width=TRIAL_CURVE.duration / 8.0),
        lambda: governed_stability(river(SEEK_LAW, 150.0, 120.0, np.inf), 0.0, [HandImpedance()]),
    ),
    "governor": (
        Follow(TRIAL_CURVE, 300.0, 8.0, 0.25) + Governor(TRIAL_CURVE, SPEEDS, 8.0),
        lambda: governed_stability(river(), 8.0, [HandImpedance()]),
    ),
    "governor that shakes": (
        Follow(TRIAL_CURVE, 300.0, 8.0, 0.25) + Governor(TRIAL_CURVE, SPEEDS, 200.0),
        lambda: governed_stability(river(), 200.0, [HandImpedance()]),
    ),
    "own law": (
        Follow(TRIAL_CURVE, 300.0, 8.0, 0.25) + CompiledLaw(_soft, {}),
        lambda: hvf.certify(simulation(Follow(CIRCLE, 300.0, 8.0, 0.25) + CompiledLaw(_soft, {})), NO_HANDS).stability,
    ),
    "own law that shakes": (
        Follow(TRIAL_CURVE, 300.0, 8.0, 0.25) + CompiledLaw(_push_away, {}),
        lambda: (
            hvf.certify(simulation(Follow(CIRCLE, 300.0, 8.0, 0.25) + CompiledLaw(_push_away, {})), NO_HANDS).stability
        ),
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_trials_oscillate_exactly_where_refuted(name):
    law, certify = LAWS[name]
    found = certify()
    verdict, example = found.verdict, found.counterexample
    rng, oscillating = np.random.default_rng(20), 0
    for _ in range(20):
        # A refutation is for the phase of its counterexample, a certificate for every phase.
        phase, across = rng.uniform(0.0, LAP_DURATION), np.array([0.0, 0.0, 1.0])
        phase = float(example["phase"]) * LAP_DURATION / 4.0 if example else phase
        trial = LawTrial(TRIAL_CURVE, phase, 8.0, Sampling(1e-3), HandImpedance(), across, law)
        loop = trial.loop()
        inverse, state = np.linalg.inv(loop.linear.jacobian[0]), np.zeros(12)
        state[:3], state[3:6] = inverse @ rng.normal(scale=2e-3, size=3), inverse @ rng.normal(scale=0.05, size=3)
        state[6:9], state[9:12] = state[:3], state[3:6]
        path = simulate(trial, 300.0, 400, WITH_FRICTION, state)
        # Acceleration in the last fifth: small for a hand that is led or at rest.
        fast = np.linalg.norm(np.diff(path[-80:], 2, axis=0), axis=1) / 1e-6
        oscillating += len(path) < 400 or float(np.median(fast)) > 5.0
    assert verdict in ("certified", "refuted")
    assert oscillating == 0 if verdict == "certified" else oscillating >= 18, (verdict, oscillating)
