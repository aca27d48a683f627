"""Flights of a figure of another stature are judged as it flies: gravity does not shrink with it."""

import re

from experiments.certify.certified_clips import certify_clips
from models.mocap.library import embedded


def test_a_small_figure_falls_too_slowly_at_the_pace_of_the_clip() -> None:
    jump = [embedded("jump")]
    assert certify_clips(jump)["ballistic"].verdict == "certified"
    small = certify_clips(jump, size=0.6)["ballistic"]
    assert small.verdict == "refuted"
    assert small.reason.startswith("jump by a figure of 1.05 m, times over 0.77: ")
    falls = re.search(r"falls at ([\d.]+)", small.reason)
    assert falls is not None
    assert abs(float(falls[1]) - 0.6 * 9.81) < 0.15
