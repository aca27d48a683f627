"""Experiment that could refute LEADING's certificate: at which gain its springs make the linkage in MuJoCo unstable.

Each trial is in one regime of the force, with a figure that hardly accelerates, so that the walker is frozen; the hand
exerts a constant force where the regime needs one. ``python -m experiments.studies.leading_trials`` prints the table of
the docs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from controllers.certificates.loop.hand import NO_HAND, HandImpedance
from controllers.certificates.loop.leading_law import Regime
from controllers.certificates.loop.linear_loop import linearise
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Program
from controllers.fields.leading import Leading
from controllers.state import HandState
from controllers.walking.gait import Gait
from controllers.walking.walked_path import STEP
from controllers.walking.walking import Walking
from experiments.certify.certified_device import phantom_device
from experiments.certify.trial_simulation import LAP_DURATION, Conditions, LoopTrial
from experiments.setups.parts.leading_hand import s_curve
from experiments.studies.trial_onset import observed, predicted
from sim.users.hand.arm import Arm

SCALE, STIFFNESS_RATIO, WALKER_RATE = 1e5, 1.5, 0.1  # S, k_z/k_l, ω [1/s]: the walker's motion is negligible
EDGE_DISTANCE = 1e-4  # [m] distance of the stylus from the edge, on the side where the spring acts
_SOFT_STIFFNESS = 1e-4  # [N/m] stiffness of an arm so soft, with a target so far away, that its force is constant
_GAIT = Gait(1.4, 1.25, np.array([2, 2]), 0.45)


@dataclass(frozen=True)
class LeadingTrial(LoopTrial):
    """A trial of LEADING, whose stiffness is k_l with k_z in proportion.

    Attributes
    ----------
    regime : Regime
        The springs that act.
    """

    regime: Regime

    def loop(self) -> SampledLoop:
        """The linearised loop at the trial's place."""
        law = self.regime.law(SCALE, STIFFNESS_RATIO)
        return SampledLoop(
            linearise(phantom_device(), law, self.curve, np.array([self.phase]), self.hand), self.sampling
        )

    def program(self, k_r: float) -> Program:
        """The field that is simulated, with k_l [N/m]."""
        return self.field(k_r).program()

    def user(self, k_r: float) -> Arm:
        """A hand that balances the field's force with a constant force."""
        place = self.curve.point(self.phase)
        force = -np.asarray(self.field(k_r).wrench(HandState.at(place)).force)
        return Arm(_SOFT_STIFFNESS, self.hand.damping, (place + force / _SOFT_STIFFNESS)[None])

    def field(self, k_l: float) -> Leading:
        """The executed law, with the figure placed such that the trial's position lies in the regime."""
        c, s = (float(x) for x in self.regime.tangent(self.curve.velocity(self.phase)))
        plain = Walking(_GAIT, scale=SCALE, heading=float(np.arctan2(s, c)), rate=WALKER_RATE)
        lead = plain.lead[0]
        path_end = (plain.path()[0] - 1.0) * STEP - plain.ahead
        edge = SCALE * EDGE_DISTANCE
        if not self.regime.beyond:
            along = -plain.backward * lead - edge if self.regime.ahead else -edge
            bend, across = plain.curvature, edge if self.regime.aside and self.regime.ahead else 0.0
        else:
            along = lead + edge if self.regime.ahead else lead - edge
            beyond = along - path_end
            bend = abs(self.regime.turn) / beyond if self.regime.turn else plain.curvature
            side = np.sign(self.regime.turn) if self.regime.turn else 1.0
            across = side * (0.5 * bend * beyond**2 + edge) if self.regime.aside else 0.0
        x, y = SCALE * self.curve.point(self.phase)[:2] - (along * c - across * s, along * s + across * c)
        walking = replace(plain, start=(x / SCALE, y / SCALE), pull=1e-3, curvature=bend)
        return Leading(walking, k_l=k_l, k_z=STIFFNESS_RATIO * k_l, b=self.b_d)


def leading_trial(
    regime: Regime, phase: float, b: float, sampling: Sampling, hand: HandImpedance = NO_HAND
) -> LeadingTrial:
    """A trial at a share `phase` of the default S, slowed down until it stands still; the hand has no stiffness."""
    curve = s_curve()
    slow = LAP_DURATION / curve.duration
    still = Trajectory(slow * np.asarray(curve.times), curve.positions, ends=curve.ends)
    return LeadingTrial(still, phase * LAP_DURATION, b, sampling, hand, np.array([0.4, 0.5, 0.77]), regime)


TRIALS: Mapping[str, LeadingTrial] = {
    "on its path": leading_trial(Regime(False, True), 0.3, 6.0, Sampling(1e-3)),
    "on its path, 45° turned, late": leading_trial(
        Regime(False, True, heading=0.25 * np.pi), 0.7, 3.0, Sampling(1e-3, 2e-3)
    ),
    "held back on its path": leading_trial(Regime(True, True), 0.5, 4.0, Sampling(2e-3, 2e-3), HandImpedance(0.1, 2.0)),
    "too far ahead": leading_trial(Regime(True, False, True), 0.2, 5.0, Sampling(1.5e-3)),
    "aside, c = 1": leading_trial(Regime(False, True, True, 1.0), 0.6, 3.0, Sampling(1e-3)),
    "too far ahead and aside, c = 2": leading_trial(Regime(True, True, True, 2.0), 0.4, 3.0, Sampling(1e-3)),
    "the same to the other side, c = −3, held": leading_trial(
        Regime(True, True, True, -3.0), 0.4, 4.0, Sampling(1e-3), HandImpedance(0.15, 1.0)
    ),
}


def main() -> None:
    """Predict and observe the critical k_l of every trial, and print the table."""
    print("| where | T [ms] | delay | b [N s/m] | predicted k_l [N/m] | in MuJoCo |", "|---" * 6 + "|", sep="\n")
    for name, trial in TRIALS.items():
        expected = predicted(trial)
        found = observed(trial, expected, Conditions())
        clock = trial.sampling
        print(
            f"| {name} | {1e3 * clock.period:g} | {clock.whole_delay} T | {trial.b_d:g} | {expected:.1f} "
            f"| {100.0 * (found / expected - 1.0):+.2f} % |",
            flush=True,
        )


if __name__ == "__main__":
    main()
