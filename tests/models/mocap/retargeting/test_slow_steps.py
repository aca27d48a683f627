"""Steps that are too slow for their length, as in a file whose stated frame rate is a fraction of the recording's."""

import re

import numpy as np
import pytest

from geometry.physics import GRAVITY
from models.mocap.library import load
from models.mocap.retargeting.slow_steps import slow_step_remarks

LEG, FPS = 0.9, 60.0


def slow_lines(tmp_path):
    return [line for line in load(tmp_path / "r.bvh").report.remarks if "times a person's time" in line]


def test_walk_stated_at_a_fraction_of_its_rate_is_remarked_with_its_rate(walk_rows, tmp_path):
    """It was recorded at 30 frames a second."""
    text = (tmp_path / "r.bvh").read_text()
    for rate, named in ((60.0, False), (30.0, False), (20.0, False), (7.5, True), (6.0, True)):
        (tmp_path / "r.bvh").write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {1.0 / rate:.7f}", text))
        lines = slow_lines(tmp_path)
        assert len(lines) == named
        if named:
            assert f"if {rate:g} frames a second are wrong, give --frame-rate, such as" in lines[0]
            assert int(lines[0].split()[-1]) == pytest.approx(30, abs=6)


def stepping(ratio, evenness=1.0):
    """Hips, and ankles relative to each hip and to their middle, of eight steps of 0.7 m, turned by 40°.

    With `evenness` 0 the hips rest during half of each step.
    """
    time = ratio * LEG * np.sqrt(LEG / GRAVITY) / 0.7
    n = round(8 * time * FPS)
    phase = np.arange(n) / (time * FPS)
    within = phase % 1.0
    travel = np.floor(phase) + evenness * within + (1.0 - evenness) * np.minimum(2.0 * within, 1.0)
    swing = 0.35 * np.cos(np.pi * phase)
    hips = np.broadcast_to([[0.0, 0.08, 0.0], [0.0, -0.08, 0.0]], (n, 2, 3))
    ankles = np.zeros((n, 2, 3))
    ankles[:, 0, 0], ankles[:, 1, 0], ankles[:, :, 2] = swing, -swing, -LEG
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    path = np.column_stack((0.7 * travel, np.zeros(n), np.full(n, LEG)))
    return path @ turn, ankles @ turn, (ankles + hips) @ turn, LEG, FPS


@pytest.mark.parametrize(
    ("ratio", "evenness", "named"), [(1.5, 1.0, False), (3.0, 1.0, False), (6.0, 1.0, True), (6.0, 0.0, False)]
)
def test_pauses_between_steps_are_not_slow_motion(ratio, evenness, named):
    assert len(list(slow_step_remarks(*stepping(ratio, evenness)))) == named


@pytest.mark.parametrize(("slower", "named"), [(1.0, False), (4.0, True)])
def test_skipping_is_not_slow_motion_but_skipping_in_slow_motion_is(slower, named):
    """Two hops a step, 4 cm high: 0.45 s each, of which half in flight at a person's pace."""
    path, *rest = stepping(6.0)
    step_time = 6.0 * LEG * np.sqrt(LEG / GRAVITY) / 0.7
    hop_time = slower * 0.18
    from_top = (np.arange(len(path)) / FPS) % (2.0 * hop_time) - hop_time
    path = path.copy()
    path[:, 2] += 0.16 - np.minimum(0.5 * GRAVITY * (from_top / slower) ** 2, 0.16)
    assert step_time > 2.0 * hop_time
    assert len(list(slow_step_remarks(path, *rest))) == named


def test_length_time_and_rate_of_the_steps_are_told():
    (line,) = slow_step_remarks(*stepping(6.0))
    assert line.startswith("steps of 0.70 m take 2.3 s each at an even pace, 4 times a person's time: ")
    assert line.endswith("give --frame-rate, such as 240")


def test_body_without_ankles_or_without_steps_has_none():
    path, legs, ankles, leg, fps = stepping(6.0)
    assert not list(slow_step_remarks(path, np.full_like(legs, np.nan), np.full_like(ankles, np.nan), leg, fps))
    assert not list(slow_step_remarks(path[:1], legs[:1], ankles[:1], leg, fps))
