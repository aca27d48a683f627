"""Flights of whole clips: embedded, captured, played too fast, and flown by the physical figure."""

import mujoco
import numpy as np
import pytest

from controllers.certificates.flight.tolerance import JudgementCriteria
from experiments.flights.ballistics import clip_ballistics, fly
from models.humanoid.skeleton import figure_spec
from models.mocap.dynamics.momentum import momentum
from models.mocap.library import embedded, load_clip
from models.mocap.motion.clip import Clip
from models.mocap.retargeting import retarget
from tests.captures import MOCAP, needs_mocap

FLIGHTS = {"cmu_amc/01_01.amc": 10, "deepmimic/humanoid3d_cartwheel.txt": 0}  # a handstand is no flight


def verdict(clip):
    return clip_ballistics(clip).certificate.verdicts["ballistic"]


@pytest.mark.parametrize(("name", "flights"), [("jump", 1), ("backflip", 1), ("run", 6), ("walk", 0), ("ginga", 0)])
def test_embedded_clips_have_expected_flights(name, flights):
    found = clip_ballistics(embedded(name))
    assert len(found.flights) == flights
    assert found.certificate.verdicts["ballistic"].verdict == "certified"
    assert all(flight.fit.gravity == pytest.approx(9.81, abs=0.1) for flight in found.flights)
    assert len(found.bounds.low) == embedded(name).n_frames


@pytest.mark.parametrize("pace", [0.8, 1.3])
def test_jump_at_wrong_pace_is_refuted(pace):
    clip = embedded("jump")
    found = verdict(Clip(clip.poses, pace * clip.fps, "played"))
    assert found.verdict == "refuted"
    assert f"{1 / pace:.2f} of its speed" in found.reason


@pytest.mark.parametrize(
    ("height", "expected"), [(-0.03, "unknown"), (-0.006, "certified"), (0.006, "certified"), (0.03, "unknown")]
)
def test_height_offset_changes_verdict_only_beyond_tolerance(height, expected):
    clip = embedded("jump")
    found = clip_ballistics(Clip(clip.poses + np.eye(75)[2] * height, clip.fps, "hovering"))
    assert found.certificate.verdicts["ballistic"].verdict == expected
    assert [flight.fit.gravity for flight in found.flights] == pytest.approx([9.81], abs=0.2)


def test_certificate_inputs_depend_on_clip_and_tolerance():
    clip = embedded("jump")
    moved = Clip(clip.poses + np.eye(75)[0] * 1e-9, clip.fps, "jump")
    hashes = {
        clip_ballistics(c, JudgementCriteria(friction=mu)).certificate.inputs
        for c, mu in ((clip, 0.9), (clip, 0.8), (moved, 0.9))
    }
    assert len(hashes) == 3


@needs_mocap
@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("deepmimic/humanoid3d_backflip.txt", "certified"), ("deepmimic/humanoid3d_spinkick.txt", "certified"),
        ("deepmimic/humanoid3d_jump.txt", "certified"), ("cmu_amc/02_04.amc", "certified"),
        ("cmu_amc/16_09.amc", "certified"), ("cmu_amc/01_01.amc", "certified"), ("cmu_amc/02_03.amc", "certified"),
        ("deepmimic/humanoid3d_cartwheel.txt", "unknown"), ("snu/cart.bvh", "unknown"),
        ("snu/walk.bvh", "certified"), ("snu/backflip.bvh", "refuted"), ("deepmimic/humanoid3d_spin.txt", "refuted"),
        ("snu/pirouette.bvh", "unknown"),
    ],
)  # fmt: skip
def test_captured_clips_get_expected_ballistic_verdicts(file, expected):
    found = clip_ballistics(load_clip(MOCAP / file))
    assert found.certificate.verdicts["ballistic"].verdict == expected
    if file in FLIGHTS:
        assert len(found.flights) == FLIGHTS[file]


@needs_mocap
def test_run_on_sloping_floor_is_unknown_without_levelling(monkeypatch):
    monkeypatch.setattr(retarget, "levelled", lambda root, segments, fps: (root, segments, 0.0))
    sloping = verdict(load_clip(MOCAP / "cmu_amc/02_03.amc"))
    assert sloping.verdict == "unknown"
    assert "from where it stands, beyond" in sloping.reason


def test_counterexample_deviates_from_simulated_free_fall():
    clip = embedded("jump")
    fast = Clip(clip.poses, 1.6 * clip.fps, "fast")
    example = verdict(fast).counterexample
    model = figure_spec().compile()
    model.opt.timestep = 2.5e-4
    data = mujoco.MjData(model)
    data.qpos, data.qvel = example["qpos"], example["qvel"]
    com = momentum(fast).com
    farthest = 0.0
    for k in range(example["start"], example["end"] + 1):
        while data.time < (k - example["start"]) / fast.fps - 1e-9:
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        farthest = max(farthest, float(np.linalg.norm(data.subtree_com[1] - com[k])))
    assert farthest == pytest.approx(example["distance"], rel=0.05)
    assert farthest > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jump", "backflip", "run"])
def test_physical_figure_flies_as_predicted_at_each_rate(name):
    found = clip_ballistics(embedded(name))
    flight = found.flights[0]
    low, high = flight.done
    inside = [1.0, 1.02 * low, *([0.98 * high] if np.isfinite(high) else [])]
    outside = [0.97 * low, *([1.03 * high] if np.isfinite(high) else [])]
    for rate in (*inside, *outside):
        trial = fly(found.clip, flight.fit, rate)
        assert trial.distance == pytest.approx(trial.predicted, abs=2e-3)
        assert (trial.distance <= 0.05) == (rate in inside)
        assert trial.residual == 0.0


@needs_mocap
@pytest.mark.slow
@pytest.mark.parametrize("file", ["deepmimic/humanoid3d_spinkick.txt", "cmu_amc/02_04.amc", "cmu_amc/16_09.amc"])
def test_captured_flights_are_flown_within_predicted_rates(file):
    found = clip_ballistics(load_clip(MOCAP / file))
    flight = found.flights[0]
    for rate, expected in (
        (1.0, True), (1.02 * flight.done[0], True), (0.98 * flight.done[1], True),
        (0.95 * flight.done[0], False), (1.08 * flight.done[1], False),
    ):  # fmt: skip
        assert (fly(found.clip, flight.fit, rate).distance <= 0.05) == expected
