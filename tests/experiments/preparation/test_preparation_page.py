"""The replay of a prepared clip beside its capture."""

import numpy as np

from experiments.preparation.page import captured_beside, filmstrip
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.preparation.looping import LoopedClip
from models.mocap.preparation.poses import resampled

FPS = 120.0


def test_capture_is_shown_at_the_moments_of_its_cycle_lap_after_lap():
    """The cycle begins at 0.5 s of a capture that is played at 0.8 of its pace."""
    walk = resampled(embedded("walk"), FPS)
    capture = Clip(np.vstack((walk.poses, walk.displacement.moved(walk.poses)[1:])), FPS / 0.8, "capture")
    lap = Clip(capture.poses[60 : 60 + walk.n_frames], FPS, "lap")
    part = LoopedClip(lap, "cycle", 0.5, 0.5 + lap.duration, 0.1)
    times = np.arange(2 * walk.n_frames - 1) / FPS
    shown = captured_beside(lap, capture, part, 0.8, times)
    expected = np.vstack((lap.poses, lap.displacement.moved(lap.poses)[1:]))
    assert lap.closes()
    assert np.abs(pose_difference(shown, expected)).max() < 1e-6


def test_capture_waits_where_its_clip_comes_to_rest():
    jump = resampled(embedded("jump"), FPS)
    cut = Clip(jump.poses[40:141], FPS, "cut")
    rest = np.repeat(cut.poses[:1], 24, axis=0), np.repeat(cut.poses[-1:], 24, axis=0)
    clip = Clip(np.vstack((rest[0], cut.poses, rest[1])), FPS, "rests")
    shown = captured_beside(clip, cut, LoopedClip(clip, "open", -0.2, cut.duration, 0.0), 1.0, np.arange(149) / FPS)
    assert np.abs(pose_difference(shown, clip.poses)).max() < 1e-6


def test_pictures_of_capture_and_clip_have_their_own_times():
    """A clip is a part of its capture: pictures above each other are of other moments."""
    walk = resampled(embedded("walk"), FPS)
    half = Clip(walk.poses[: walk.n_frames // 2 + 1], FPS, "half")
    captured, prepared = filmstrip({"as captured": walk, "prepared": half}).axes
    for axes, clip in ((captured, walk), (prepared, half)):
        told = [text.get_text() for text in axes.texts]
        assert (told[0], told[-1]) == ("0.0 s", f"{clip.duration:.1f} s")
