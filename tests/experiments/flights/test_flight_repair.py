"""Repair of clips whose flights are not ballistic: timing, angular momentum, clearance over the floor."""

import numpy as np
import pytest

from experiments.flights.ballistics import clip_ballistics, fly
from experiments.flights.repair import over_the_floor, repair_clip, repair_file
from models.errors import ModelError
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded, load_clip
from models.mocap.motion.clip import Clip
from tests.captures import MOCAP, needs_mocap

UP = np.eye(75)[2]


@pytest.mark.slow
@pytest.mark.parametrize("pace", [0.75, 1.6])
def test_repaired_flight_conserves_angular_momentum_and_falls_freely(pace):
    clip = embedded("jump")
    after = repair_clip(Clip(clip.poses, pace * clip.fps, "wrong")).after
    assert after.certificate.verdicts["ballistic"].verdict == "certified"
    fit = after.flights[0].fit
    momentum = after.motion.angular[fit.start + 2 : fit.end - 1]
    assert np.ptp(momentum, axis=0).max() < 0.3  # kg m²/s
    assert fit.misfit < 5e-3
    assert np.rad2deg(fit.drift) < 2.0


@pytest.mark.slow
def test_jump_below_the_floor_is_lifted_out():
    clip = embedded("jump")
    sunk = Clip(clip.poses - 0.07 * UP, 1.2 * clip.fps, "sunk")
    repaired = repair_clip(sunk)
    assert contacts(sunk).clearance.min() < -0.069
    assert contacts(repaired.clip).clearance.min() > -0.01
    assert repaired.after.certificate.verdicts["ballistic"].verdict == "certified"


def test_lift_is_smooth_and_leaves_valid_clips_unchanged():
    clip = embedded("walk")
    assert over_the_floor(clip) is clip
    x = np.linspace(0.0, 1.0, clip.n_frames)
    sunk = clip.poses - 0.05 * np.outer(np.exp(-(((x - 0.5) / 0.1) ** 2)), UP)
    lifted = over_the_floor(Clip(sunk, clip.fps, "sunk"))
    assert contacts(lifted).clearance.min() > -0.002
    assert np.abs(np.diff(lifted.poses[:, 2] - sunk[:, 2], 2)).max() * clip.fps**2 < 15.0


@pytest.mark.slow
@pytest.mark.parametrize("pace", [0.75, 1.6])
def test_jump_at_wrong_pace_is_repaired(pace):
    clip = embedded("jump")
    wrong = Clip(clip.poses, pace * clip.fps, "wrong")
    repaired = repair_clip(wrong)
    after = repaired.after
    assert after.certificate.verdicts["ballistic"].verdict == "certified"
    assert max(flight.fit.gravity for flight in after.flights) == pytest.approx(9.81, abs=0.1)
    # Standing feet are not pushed deeper into the floor.
    assert contacts(repaired.clip).clearance.min() > contacts(wrong).clearance.min() - 5e-3
    assert np.linalg.norm(repaired.clip.velocities()[:, 6:].reshape(-1, 17, 3), axis=2).max() < 30.0


def test_valid_flight_is_left_unchanged():
    clip = embedded("backflip")
    repaired = repair_clip(clip)
    assert repaired.clip is clip
    assert repaired.plan is None


@pytest.mark.slow
@needs_mocap
def test_infeasible_backflip_falls_with_g_after_repair(tmp_path):
    target = tmp_path / "mended.bvh"
    repair_file(MOCAP / "snu" / "backflip.bvh", target)
    after = clip_ballistics(load_clip(target))
    assert max(flight.fit.gravity for flight in after.flights) == pytest.approx(9.81, abs=0.1)
    assert {flight.verdict for flight in after.flights} == {"certified"}
    assert max(np.rad2deg(flight.fit.drift) for flight in after.flights) < 3.0
    # Its soles still hover, which repair of flights does not change.
    judged = after.certificate.verdicts["ballistic"]
    assert judged.verdict == "unknown"
    assert "from where it stands" in judged.reason
    with pytest.raises(ModelError, match="exists"):
        repair_file(MOCAP / "snu" / "backflip.bvh", target)
    with pytest.raises(ModelError, match="BVH"):
        repair_file(MOCAP / "snu" / "backflip.bvh", tmp_path / "mended.amc")


@needs_mocap
@pytest.mark.slow
def test_repaired_clip_is_flown_by_the_physical_figure():
    repaired = repair_clip(load_clip(MOCAP / "snu" / "backflip.bvh"))
    for found, expected in ((repaired.before, False), (repaired.after, True)):
        trial = fly(found.clip, found.flights[0].fit, 1.0)
        assert (trial.distance <= 0.05) == expected
