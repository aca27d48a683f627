"""Flights are certified between contacts that can be contact, and of the animation as it was played; repairs fly."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.certify.certified_clips import PLAYED, certify_clips, played
from experiments.flights.ballistics import clip_ballistics
from experiments.flights.repair import over_the_floor, repair_clip
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip

UP = np.eye(75)[2]


def ballistic(poses, fps, name="made"):
    return clip_ballistics(Clip(poses, fps, name)).certificate.verdicts["ballistic"]


def standing(seconds=2.0, fps=60.0):
    clip = embedded("cheer")
    return np.tile(clip.poses[0], (round(seconds * fps), 1)), fps


@pytest.mark.parametrize("height", [0.02, 0.035, 0.059])
@pytest.mark.parametrize("name", ["walk", "cheer"])
def test_a_clip_that_hovers_is_not_certified(name, height):
    clip = embedded(name)
    found = ballistic(clip.poses + height * UP, clip.fps)
    assert found.verdict == "unknown"
    assert f"{1e3 * height:.0f} mm over the floor" in found.reason


@pytest.mark.parametrize(("height", "speed"), [(0.025, 3.0), (0.0, 3.0), (0.0, 1.5), (0.0, 0.3)])
def test_a_body_that_glides_is_not_certified(height, speed):
    poses, fps = standing()
    poses = poses + height * UP + np.outer(np.arange(len(poses)) / fps * speed, np.eye(75)[0])
    assert ballistic(poses, fps).verdict == "unknown"


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_a_jump_in_one_frame_is_not_certified(fps):
    poses, _ = standing(2.0, fps)
    poses[len(poses) // 2 :, 0] += 1.0
    found = ballistic(poses, fps)
    assert found.verdict == "unknown"
    assert "jumps at" in found.reason


def test_a_turn_in_the_air_that_begins_and_ends_there_is_refuted():
    clip = embedded("jump")
    fit = clip_ballistics(clip).flights[0].fit
    x = np.clip((np.arange(clip.n_frames) - fit.start) / (fit.end - fit.start), 0.0, 1.0)
    half = 0.25 * np.pi * (1.0 - np.cos(np.pi * x)) / 2.0
    poses = clip.poses.copy()
    for k, angle in enumerate(half):
        c, s = np.cos(angle), np.sin(angle)
        w, a, b, d = poses[k, 3:7]
        poses[k, 3:7] = c * w - s * d, c * a - s * b, c * b + s * a, c * d + s * w
    found = ballistic(poses, clip.fps)
    assert found.verdict == "refuted"
    assert "about the vertical" in found.reason


@pytest.mark.parametrize("name", ["walk", "run", "jump", "backflip", "spin", "angry", "cheer", "squat_dance", "ginga"])
def test_embedded_clips_stay_certified(name):
    assert clip_ballistics(embedded(name)).certificate.verdicts["ballistic"].verdict == "certified"


def test_rates_in_the_millions_are_not_told():
    poses, fps = standing()
    found = clip_ballistics(Clip(poses + 1e-9 * np.random.default_rng(0).normal(size=poses.shape), fps, "still"))
    assert all(float(number) < 1e4 for number in re.findall(r"\d+\.\d+", " ".join(found.lines())))


def test_an_animation_is_judged_as_it_was_played_and_every_clip_is_listed():
    clip, rate = embedded("jump"), 500.0
    pace = 0.65
    frames = np.clip(np.arange(0.0, 1.0 + clip.duration / pace, 1.0 / rate) - 1.0, 0.0, None) * pace * clip.fps
    poses = clip.poses[np.minimum(np.round(frames).astype(int), clip.n_frames - 1)]
    of_run = SimpleNamespace(texts={}, groups={"frames": {"reference": poses}}, rates={"frames": rate},
                             channel=lambda group, name: poses)  # fmt: skip
    (taken,) = played(of_run)
    told = certify_clips((embedded("walk"), clip, taken))["ballistic"]
    assert told.verdict == "refuted"
    assert told.reason.startswith(PLAYED)
    assert told.figures["clips"] == {"walk": "certified", "jump": "certified", PLAYED: "refuted"}
    assert "each: walk certified, jump certified, as played refuted" in told.reason


# Repair.


@pytest.mark.slow
@pytest.mark.parametrize("pace", [0.75, 1.6])
def test_a_repaired_flight_keeps_its_angular_momentum_and_its_fall(pace):
    clip = embedded("jump")
    after = repair_clip(Clip(clip.poses, pace * clip.fps, "wrong")).after
    assert after.certificate.verdicts["ballistic"].verdict == "certified"
    fit = after.flights[0].fit
    momentum = after.motion.angular[fit.start + 2 : fit.end - 1]
    assert np.ptp(momentum, axis=0).max() < 0.3  # kg m²/s; one jump left with +8.4 to −7.6
    assert fit.misfit < 5e-3
    assert np.rad2deg(fit.drift) < 2.0


@pytest.mark.slow
def test_a_jump_below_the_floor_is_lifted_out_of_it():
    clip = embedded("jump")
    sunk = Clip(clip.poses - 0.07 * UP, 1.2 * clip.fps, "sunk")
    done = repair_clip(sunk)
    assert contacts(sunk).clearance.min() < -0.069
    assert contacts(done.clip).clearance.min() > -0.01
    assert done.after.certificate.verdicts["ballistic"].verdict == "certified"


def test_a_lift_is_smooth_and_leaves_what_is_over_the_floor():
    clip = embedded("walk")
    assert over_the_floor(clip) is clip
    x = np.linspace(0.0, 1.0, clip.n_frames)
    sunk = clip.poses - 0.05 * np.outer(np.exp(-(((x - 0.5) / 0.1) ** 2)), UP)
    lifted = over_the_floor(Clip(sunk, clip.fps, "sunk"))
    assert contacts(lifted).clearance.min() > -0.002
    assert np.abs(np.diff(lifted.poses[:, 2] - sunk[:, 2], 2)).max() * clip.fps**2 < 15.0
