"""Repeats of clips in a lap: strides are counted, and gaits take as many of them."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.lifting.repeats import gait_strides, repeated
from models.mocap.library import embedded


def one_stride(name, strides):
    clip = embedded(name)
    return replace(clip, poses=clip.poses[: (clip.n_frames - 1) // strides + 1])


@pytest.mark.parametrize(
    ("clip", "strides"),
    [
        (embedded("walk"), 2), (embedded("run"), 3), (one_stride("walk", 2), 1), (one_stride("run", 3), 1),
        (embedded("jump"), 0), (embedded("squat_dance"), 0), (embedded("angry"), 0),
    ],
    ids=["walk", "run", "one stride of walk", "one stride of run", "jump", "dance", "angry"],
)  # fmt: skip
def test_strides_of_a_gait_are_counted(clip, strides):
    assert gait_strides(clip) == strides


def test_walk_and_run_take_as_many_strides_in_a_lap_and_left_swings_with_left():
    (walk, run, jump), rounds = repeated([embedded("walk"), embedded("run"), embedded("jump")])
    assert rounds == (3, 3, 1)
    assert (walk.duration, run.duration) == (pytest.approx(3.3), pytest.approx(2.2))
    assert jump.duration == embedded("jump").duration
    # Of the stride that is repeated nothing changes but the place over the ground.
    steps = [(clip.n_frames - 1) // 3 for clip in (walk, run)]
    for clip, n in zip((walk, run), steps, strict=True):
        np.testing.assert_allclose(clip.poses[n:, 3:], clip.poses[:-n, 3:], atol=1e-9)


def test_gaits_without_a_common_lap_of_bearable_length_are_repeated_as_they_are():
    fast = replace(embedded("run"), fps=4 * embedded("run").fps)  # strides of 0.18 s: eleven in a lap
    (walk, run), rounds = repeated([embedded("walk"), fast])
    assert rounds == (1, 4)
    assert walk.duration == pytest.approx(2.2)
    assert run.duration == pytest.approx(4 * 0.55)


def test_a_gait_alone_keeps_its_lap():
    (walk, dance), rounds = repeated([embedded("walk"), embedded("squat_dance")])
    assert (walk.duration, dance.duration) == (pytest.approx(2.2), embedded("squat_dance").duration)
    assert rounds == (2, 1)
