"""Flights of whole clips: embedded, captured, played too fast, and flown by the physical figure."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from controllers.certificates.flight.tolerance import Judging
from experiments.flights.ballistics import clip_ballistics, fly
from experiments.flights.repair import repair_clip, repair_file
from models.errors import ModelError
from models.humanoid.skeleton import figure_spec
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.library import embedded, load_clip
from models.mocap.motion.clip import Clip
from models.mocap.retargeting import retarget

SHARED = Path(__file__).resolve().parents[3] / ".." / "shared" / "mocap"
shared = pytest.mark.skipif(not SHARED.is_dir(), reason="motion capture is not at ../shared/mocap")


def verdict(clip):
    return clip_ballistics(clip).certificate.verdicts["ballistic"]


@pytest.mark.parametrize(("name", "flights"), [("jump", 1), ("backflip", 1), ("run", 6), ("walk", 0), ("ginga", 0)])
def test_embedded_clips_fly_as_they_should(name, flights):
    found = clip_ballistics(embedded(name))
    assert len(found.flights) == flights
    assert found.certificate.verdicts["ballistic"].verdict == "certified"
    assert all(flight.fit.gravity == pytest.approx(9.81, abs=0.1) for flight in found.flights)
    assert len(found.bounds.low) == embedded(name).n_frames


@pytest.mark.parametrize("pace", [0.8, 1.3])
def test_a_jump_played_too_slowly_or_too_fast_is_refuted(pace):
    clip = embedded("jump")
    found = verdict(Clip(clip.poses, pace * clip.fps, "played"))
    assert found.verdict == "refuted"
    assert f"{1 / pace:.2f} of its speed" in found.reason


@pytest.mark.parametrize(
    ("height", "expected"), [(-0.03, "unknown"), (-0.006, "certified"), (0.006, "certified"), (0.03, "unknown")]
)
def test_a_floor_that_is_missed_by_millimetres_changes_no_verdict_and_no_gravity_by_centimetres(height, expected):
    clip = embedded("jump")
    found = clip_ballistics(Clip(clip.poses + np.eye(75)[2] * height, clip.fps, "hovering"))
    assert found.certificate.verdicts["ballistic"].verdict == expected
    assert [flight.fit.gravity for flight in found.flights] == pytest.approx([9.81], abs=0.2)


def test_the_certificate_is_of_one_clip_and_one_tolerance():
    clip = embedded("jump")
    moved = Clip(clip.poses + np.eye(75)[0] * 1e-9, clip.fps, "jump")
    hashes = {
        clip_ballistics(c, Judging(friction=mu)).certificate.inputs
        for c, mu in ((clip, 0.9), (clip, 0.8), (moved, 0.9))
    }
    assert len(hashes) == 3


@shared
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
def test_real_jumps_and_flips_are_told_from_impossible_ones(file, expected):
    assert verdict(load_clip(SHARED / file)).verdict == expected


@shared
def test_a_run_over_a_floor_that_slopes_does_not_stand_on_it_until_it_is_levelled(monkeypatch):
    monkeypatch.setattr(retarget, "levelled", lambda root, segments, fps: (root, segments, 0.0))
    sloping = verdict(load_clip(SHARED / "cmu_amc/02_03.amc"))
    assert sloping.verdict == "unknown"
    assert "from where it stands, beyond" in sloping.reason


@shared
@pytest.mark.parametrize(("file", "flights"), [("cmu_amc/01_01.amc", 10), ("deepmimic/humanoid3d_cartwheel.txt", 0)])
def test_flights_are_counted_and_hands_are_no_flight(file, flights):
    assert len(clip_ballistics(load_clip(SHARED / file)).flights) == flights


def test_a_refuted_flight_is_shown_false_by_a_body_that_falls():
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
@pytest.mark.parametrize("pace", [0.75, 1.6])
def test_a_jump_at_the_wrong_pace_is_repaired(pace):
    clip = embedded("jump")
    wrong = Clip(clip.poses, pace * clip.fps, "wrong")
    repaired = repair_clip(wrong)
    after = repaired.after
    assert after.certificate.verdicts["ballistic"].verdict == "certified"
    assert max(flight.fit.gravity for flight in after.flights) == pytest.approx(9.81, abs=0.1)
    # Feet that stood do not go deeper into the floor than they did.
    assert contacts(repaired.clip).clearance.min() > contacts(wrong).clearance.min() - 5e-3
    assert np.linalg.norm(repaired.clip.velocities()[:, 6:].reshape(-1, 17, 3), axis=2).max() < 30.0


def test_what_flies_is_left_alone():
    clip = embedded("backflip")
    repaired = repair_clip(clip)
    assert repaired.clip is clip
    assert repaired.plan is None


@pytest.mark.slow
@shared
def test_the_impossible_backflip_falls_with_g_after_repair(tmp_path):
    target = tmp_path / "mended.bvh"
    repair_file(SHARED / "snu" / "backflip.bvh", target)
    after = clip_ballistics(load_clip(target))
    assert max(flight.fit.gravity for flight in after.flights) == pytest.approx(9.81, abs=0.1)
    assert {flight.verdict for flight in after.flights} == {"certified"}
    assert max(np.rad2deg(flight.fit.drift) for flight in after.flights) < 3.0
    # What remains is that its soles hover, which no flight mends.
    judged = after.certificate.verdicts["ballistic"]
    assert judged.verdict == "unknown"
    assert "from where it stands" in judged.reason
    with pytest.raises(ModelError, match="exists"):
        repair_file(SHARED / "snu" / "backflip.bvh", target)
    with pytest.raises(ModelError, match="BVH"):
        repair_file(SHARED / "snu" / "backflip.bvh", tmp_path / "mended.amc")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jump", "backflip", "run"])
def test_the_physical_figure_does_what_the_certificate_predicts(name):
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


@shared
@pytest.mark.slow
@pytest.mark.parametrize("file", ["deepmimic/humanoid3d_spinkick.txt", "cmu_amc/02_04.amc", "cmu_amc/16_09.amc"])
def test_captured_flights_are_flown_as_predicted(file):
    found = clip_ballistics(load_clip(SHARED / file))
    flight = found.flights[0]
    for rate, expected in (
        (1.0, True), (1.02 * flight.done[0], True), (0.98 * flight.done[1], True),
        (0.95 * flight.done[0], False), (1.08 * flight.done[1], False),
    ):  # fmt: skip
        assert (fly(found.clip, flight.fit, rate).distance <= 0.05) == expected


@shared
@pytest.mark.slow
def test_what_is_repaired_is_flown():
    repaired = repair_clip(load_clip(SHARED / "snu" / "backflip.bvh"))
    for found, expected in ((repaired.before, False), (repaired.after, True)):
        trial = fly(found.clip, found.flights[0].fit, 1.0)
        assert (trial.distance <= 0.05) == expected
