"""What is certified is what runs: every law of the executed program."""

import re
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

import hvf
from controllers.certificates.loop.executed import looked_at
from controllers.certificates.loop.governed import governed_stability, most_drag
from controllers.certificates.loop.hand import NO_HANDS, HandImpedance
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW, SEEK_LAW
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import River, neighbours
from controllers.certificates.report import Verdict, hash_of, leaving_out
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.governor import Governor
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.fields.stretchy_tubes import StretchyTubes
from experiments.certify.certificate_page import certificate_page
from experiments.certify.certified_device import phantom_device
from experiments.certify.certified_field import certificate_inputs
from experiments.certify.certify import certify_into
from experiments.certify.trial_simulation import LAP, Conditions, Trial, simulate
from experiments.cli import main
from experiments.config.words import run_config
from models.mocap.library import embedded

CIRCLE = Trajectory.circle(0.0477, 4.0)
STILL = Trajectory.circle(0.0477, LAP)
DEVICE = phantom_device()
# Encoders that round would show accelerations in the path that nothing has.
RUBBING = Conditions(8, mujoco.mjtIntegrator.mjINT_IMPLICITFAST, coulomb=True)


def river(law=FOLLOW_LAW, k_r=300.0, b_d=8.0, width=0.25, curve=CIRCLE):
    return River(law, k_r, b_d, width, curve, DEVICE, Sampling(1e-3))


# Every law of the program.


def inputs(**words):
    return hash_of(certificate_inputs(run_config(**words), 0.0, NO_HANDS, 1.0))


def test_a_certificate_is_of_every_law_that_is_executed():
    clips = ("backflip",)
    told = {
        inputs(clips=clips),
        inputs(clips=clips, governor=True),
        inputs(clips=clips, governor=True, governor_drag=200.0),
        inputs(clips=clips, walls=True),
        inputs(clips=clips, walls=True, wall_stiffness=0.2),
        inputs(clips=clips, orientation_stiffness=0.05),
        inputs(clips=clips, mode="bunny"),
        inputs(clips=clips, mode="bunny", bunny_pace="clock"),
        inputs(clips=clips, mode="bunny", bunny_attraction="convolution"),
        inputs(clips=clips, mode="stretch"),
        inputs(clips=clips, mode="stretch", rubber_from="stylus"),
    }
    assert len(told) == 11


def test_a_governor_is_certified_as_far_as_the_circle_criterion_goes_and_refuted_where_it_shakes():
    hands = [HandImpedance(), HandImpedance(0.1, 2.0, 100.0)]
    soft, hard, between = (governed_stability(river(), drag, hands) for drag in (8.0, 200.0, 45.0))
    assert (soft.verdict, hard.verdict, between.verdict) == ("certified", "refuted", "unknown")
    assert 20.0 < soft.figures["governor_certain"] < 45.0
    assert "governor of 200" in hard.reason
    assert hard.counterexample["growth_rate"] > 100.0


def test_the_circle_criterion_lies_below_the_drag_at_which_the_loop_is_unstable():
    loop = SampledLoop(river().still(), Sampling(1e-3))
    assert 0.3 < most_drag(loop, 300.0, 8.0) / 70.0 < 1.0
    assert most_drag(loop, 20_000.0, 8.0) == 0.0


def simulation(field):
    clips = [embedded("walk")]
    return hvf.Simulation(field=field, haptic_map=hvf.Cylindrical(clips, around=CIRCLE), figure=hvf.Figure(kind="none"))


@pytest.mark.slow
def test_a_simulation_is_certified_with_its_governor_and_refuted_with_one_that_shakes():
    speeds = np.tile([0.1, 0.2], (8, 1))
    field = Follow(CIRCLE, 300.0, 8.0, 0.25)
    plain, soft, hard = (
        hvf.certify(simulation(law), NO_HANDS)
        for law in (field, field + Governor(CIRCLE, speeds, 8.0), field + Governor(CIRCLE, speeds, 200.0))
    )
    assert [it.stability.verdict for it in (plain, soft, hard)] == ["certified", "certified", "refuted"]
    assert len({plain.inputs_hash, soft.inputs_hash, hard.inputs_hash}) == 3


@pytest.mark.slow
def test_what_no_certificate_covers_is_unknown_and_named():
    tubes = StretchyTubes(CIRCLE, 150.0, 150.0, 14.0)
    found = hvf.certify(simulation(tubes), NO_HANDS).stability
    assert found.verdict == "unknown"
    assert "StretchyTubes" in found.reason
    assert "no oscillation grows at" in found.reason
    certified = Verdict("certified", "stable", 1.0)
    assert leaving_out(certified, ["walls", "gates"]).reason == "left out: walls and gates; without: stable"
    assert leaving_out(Verdict("refuted", "no", None, (), {"p": 1}), ["walls"]).verdict == "refuted"


def test_a_program_is_looked_at_as_it_runs():
    stable = looked_at(
        Follow(CIRCLE, 300.0, 8.0, 0.25).program(), river(k_r=1.0, b_d=0.0), 0.02, [HandImpedance()], n=4
    )
    shaking = looked_at(Follow(CIRCLE, 2e4, 8.0, 0.25).program(), river(k_r=1.0, b_d=0.0), 0.02, [HandImpedance()], n=4)
    assert stable.radius < 1.0 < shaking.radius
    # The differences are the derivatives: on the curve the radius is the symbolic one.
    exact = SampledLoop(river(k_r=2e4).still_at(river().phases(4)), Sampling(1e-3)).radius(2e4, 8.0).max()
    assert shaking.radius >= exact - 1e-3


def test_a_law_of_time_is_looked_at_in_the_first_lap():
    """And not at the times of the curve that is slowed down for the plant: there this law is as stiff as a wall."""

    @hvf.law
    def later(hand, k=0.01):
        return 0.0, 0.0, -k * hand.t

    seen = looked_at((Follow(CIRCLE, 300.0, 8.0, 0.25) + later).program(), river(), 0.02, [HandImpedance()], n=4)
    assert seen.radius < 1.0
    assert seen.strongest < 10.0


@pytest.mark.slow
def test_the_command_refutes_the_run_that_shakes(tmp_path):
    field = ["--clips", "backflip", "--governor", "--governor-drag", "200"]
    assert main(["certify", *field, "--no-hand", "--json", "--out", str(tmp_path / "governed")]) == 0
    text = (tmp_path / "governed" / "certificate.json").read_text()
    assert re.search(r'"stability": \{\s*"verdict": "refuted"', text)
    assert main(["run", *field, "--figure", "none", "--seconds", "3", "--out", str(tmp_path / "run")]) == 0
    assert '"since": null' not in (tmp_path / "run" / "summary.json").read_text()


@dataclass(frozen=True)
class LawTrial(Trial):
    """A trial with a law of its own."""

    law: Law

    def program(self, k_r):
        return self.law.program()


def _push_away(hand):
    return (2000.0 * hand.p[0] - 100.0 * hand.v[0], -100.0 * hand.v[1], -100.0 * hand.v[2])


def _soft(hand):
    return (-20.0 * hand.p[0], -20.0 * hand.p[1], -20.0 * hand.p[2])


SPEEDS = np.tile([0.05, 0.1], (8, 1))
LAWS = {
    "follow": (Follow(STILL, 300.0, 8.0, 0.25), lambda: governed_stability(river(), 0.0, [HandImpedance()])),
    "follow, too stiff": (
        Follow(STILL, 12_000.0, 8.0, 0.25), lambda: governed_stability(river(k_r=12_000.0), 0.0, [HandImpedance()]),
    ),
    "bunny": (
        Bunny(STILL, 300.0, 8.0, 0.05, pace="wait"),
        lambda: governed_stability(river(BUNNY_LAW, width=0.05), 0.0, [HandImpedance()]),
    ),
    "seek": (
        StretchyTubes(STILL, 150.0, 150.0, 14.0, width=STILL.duration / 8.0),
        lambda: governed_stability(river(SEEK_LAW, 150.0, 14.0, np.inf), 0.0, [HandImpedance()]),
    ),
    "seek, too damped": (
        StretchyTubes(STILL, 150.0, 150.0, 120.0, width=STILL.duration / 8.0),
        lambda: governed_stability(river(SEEK_LAW, 150.0, 120.0, np.inf), 0.0, [HandImpedance()]),
    ),
    "governor": (
        Follow(STILL, 300.0, 8.0, 0.25) + Governor(STILL, SPEEDS, 8.0),
        lambda: governed_stability(river(), 8.0, [HandImpedance()]),
    ),
    "governor that shakes": (
        Follow(STILL, 300.0, 8.0, 0.25) + Governor(STILL, SPEEDS, 200.0),
        lambda: governed_stability(river(), 200.0, [HandImpedance()]),
    ),
    "own law": (
        Follow(STILL, 300.0, 8.0, 0.25) + CompiledLaw(_soft, {}),
        lambda: hvf.certify(simulation(Follow(CIRCLE, 300.0, 8.0, 0.25) + CompiledLaw(_soft, {})), NO_HANDS).stability,
    ),
    "own law that shakes": (
        Follow(STILL, 300.0, 8.0, 0.25) + CompiledLaw(_push_away, {}),
        lambda: (
            hvf.certify(simulation(Follow(CIRCLE, 300.0, 8.0, 0.25) + CompiledLaw(_push_away, {})), NO_HANDS).stability
        ),
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_what_is_certified_never_shakes_and_what_is_refuted_does(name):
    law, certify = LAWS[name]
    found = certify()
    verdict, example = found.verdict, found.counterexample
    rng, shook = np.random.default_rng(20), 0
    for _ in range(20):
        # Refuted is a place, the counterexample's; certified is every place.
        phase, across = rng.uniform(0.0, LAP), np.array([0.0, 0.0, 1.0])
        phase = float(example["phase"]) * LAP / 4.0 if example else phase
        trial = LawTrial(STILL, phase, 8.0, Sampling(1e-3), HandImpedance(), across, law)
        loop = trial.loop()
        inverse, state = np.linalg.inv(loop.linear.jacobian[0]), np.zeros(12)
        state[:3], state[3:6] = inverse @ rng.normal(scale=2e-3, size=3), inverse @ rng.normal(scale=0.05, size=3)
        state[6:9], state[9:12] = state[:3], state[3:6]
        path = simulate(trial, 300.0, 400, RUBBING, state)
        # Acceleration of the last fifth: a hand that is carried or rests has little of it.
        fast = np.linalg.norm(np.diff(path[-80:], 2, axis=0), axis=1) / 1e-6
        shook += len(path) < 400 or float(np.median(fast)) > 5.0
    assert verdict in ("certified", "refuted")
    assert shook == 0 if verdict == "certified" else shook >= 18, (verdict, shook)


def test_the_last_phase_of_a_closed_curve_is_compared_with_the_first():
    here, following = neighbours(np.array([[1.0, 2.0, 7.0]]), periodic=True)
    assert np.abs(following - here).max() == 6.0
    here, following = neighbours(np.array([[1.0, 2.0, 7.0]]), periodic=False)
    assert np.abs(following - here).max() == 5.0


# Gains that nobody means, and a page for people.


@pytest.mark.parametrize("option", ["--stiffness", "--damping"])
def test_gains_beyond_any_device_are_refused_in_one_line(option, tmp_path, capsys):
    assert main(["run", option, "1e308", "--out", str(tmp_path / "none")]) == 2
    assert "expected at most" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_the_page_has_words_and_units_and_no_arrays(tmp_path):
    certificate = certify_into(run_config(), tmp_path, hands=NO_HANDS)
    page = (tmp_path / "certificate.html").read_text()
    assert "array(" not in page
    assert "critical damping b_d, no hand</td><td>" in page
    assert "N s/m" in page
    assert "HandImpedance(" not in certificate_page(certificate, {}).split("Counterexample")[1]
