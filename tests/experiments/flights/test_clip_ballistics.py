"""Ballistic verdicts on clips whose contacts or flights no body can have, and on the embedded ones."""

import re

import numpy as np
import pytest

from experiments.flights.ballistics import clip_ballistics
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
def test_hovering_clip_is_unknown(name, height):
    clip = embedded(name)
    found = ballistic(clip.poses + height * UP, clip.fps)
    assert found.verdict == "unknown"
    assert f"{1e3 * height:.0f} mm over the floor" in found.reason


@pytest.mark.parametrize(("height", "speed"), [(0.025, 3.0), (0.0, 3.0), (0.0, 1.5), (0.0, 0.3)])
def test_gliding_body_is_unknown(height, speed):
    poses, fps = standing()
    poses = poses + height * UP + np.outer(np.arange(len(poses)) / fps * speed, np.eye(75)[0])
    assert ballistic(poses, fps).verdict == "unknown"


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_position_jump_in_one_frame_is_unknown(fps):
    poses, _ = standing(2.0, fps)
    poses[len(poses) // 2 :, 0] += 1.0
    found = ballistic(poses, fps)
    assert found.verdict == "unknown"
    assert "jumps at" in found.reason


def test_turn_that_begins_and_ends_in_flight_is_refuted():
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
def test_embedded_clips_are_certified(name):
    assert clip_ballistics(embedded(name)).certificate.verdicts["ballistic"].verdict == "certified"


def test_report_of_noisy_clip_has_no_huge_rates():
    poses, fps = standing()
    found = clip_ballistics(Clip(poses + 1e-9 * np.random.default_rng(0).normal(size=poses.shape), fps, "still"))
    reasons = " ".join(verdict.reason for verdict in found.certificate.verdicts.values())
    assert all(float(number) < 1e4 for number in re.findall(r"\d+\.\d+", reasons))
