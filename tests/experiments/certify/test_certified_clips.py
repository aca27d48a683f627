"""Ballistic verdicts on the clips of a run: of a figure of another stature, and of the animation as it was played."""

import re
from types import SimpleNamespace

import numpy as np

from experiments.certify.certified_clips import PLAYED, certify_clips, played
from models.mocap.library import embedded


def test_flight_of_small_figure_at_clip_pace_is_refuted() -> None:
    jump = [embedded("jump")]
    assert certify_clips(jump)["ballistic"].verdict == "certified"
    small = certify_clips(jump, size=0.6)["ballistic"]
    assert small.verdict == "refuted"
    assert small.reason.startswith("jump by a figure of 1.05 m, times over 0.77: ")
    falls = re.search(r"falls at ([\d.]+)", small.reason)
    assert falls is not None
    assert abs(float(falls[1]) - 0.6 * 9.81) < 0.15


def test_animation_is_judged_as_played_and_every_clip_is_listed():
    clip, rate = embedded("jump"), 500.0
    pace = 0.65
    frames = np.clip(np.arange(0.0, 1.0 + clip.duration / pace, 1.0 / rate) - 1.0, 0.0, None) * pace * clip.fps
    poses = clip.poses[np.minimum(np.round(frames).astype(int), clip.n_frames - 1)]
    recording = SimpleNamespace(texts={}, groups={"frames": {"reference": poses}}, rates={"frames": rate},
                             channel=lambda group, name: poses)  # fmt: skip
    (played_clip,) = played(recording)
    verdict = certify_clips((embedded("walk"), clip, played_clip))["ballistic"]
    assert verdict.verdict == "refuted"
    assert verdict.reason.startswith(PLAYED)
    assert verdict.figures["clips"] == {"walk": "certified", "jump": "certified", PLAYED: "refuted"}
    assert "each: walk certified, jump certified, as played refuted" in verdict.reason
