"""The pace of a clip on its river: a push along the curve does not speed it up, and it stops with the hand."""

from typing import NamedTuple

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_SIZE
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import CLIP_PHASE, HAND_PHASE
from controllers.state import stylus_path
from experiments.fitting.figure_legs import figure_legs, packed_legs
from experiments.setups.parts.clips import load_clips
from models.humanoid.skeleton import figure_model
from sim.reference.reference import make_reference, reference_along

LAP, PERIOD = 3.4, 2e-3
FIGURE = figure_model()
CURVE = Trajectory.circle(0.0477, LAP)
PUSHED, BUMP, LEAD = 1.0, 0.25, 0.08  # [s]: start and duration of a push, and how far it moves the hand ahead


class Played(NamedTuple):
    """Ticks of a reference: phases of the hand and of the clip [s], and velocity and acceleration of the reference."""

    hand: np.ndarray
    clip: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@pytest.fixture(scope="module")
def walk() -> RiverClips:
    clips = [(clip.poses, clip.fps) for clip in load_clips(("walk",))[0]]
    return RiverClips([CURVE], clips, 0.015, figure_legs(FIGURE), LAP)


def _played(clips: RiverClips, phases: np.ndarray) -> Played:
    """Ticks of a reference whose hand is at given phases of the river [s]."""
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, 0.4, packed_legs(FIGURE))
    traces, poses = np.zeros((1, TRACE_SIZE)), np.empty((1, 75))
    rows = []
    for point, phase in zip(stylus_path(CURVE.point(phases % LAP)), phases, strict=True):
        traces[0, TRACE_PHASE] = phase % LAP
        reference_along(reference, point[None], traces, poses)
        memory = reference.memory
        rows.append((memory[HAND_PHASE], memory[CLIP_PHASE], reference.velocity.copy(), reference.acceleration.copy()))
    hand, clip, velocity, acceleration = zip(*rows, strict=True)
    hand, clip = (np.unwrap(np.array(values), period=LAP) for values in (hand, clip))
    return Played(hand, clip, np.array(velocity), np.array(acceleration))


def _bumped_phases(seconds: float) -> np.ndarray:
    t = np.arange(round(seconds / PERIOD)) * PERIOD
    s = np.clip((t - PUSHED) / BUMP, 0.0, 1.0)
    return t + LEAD * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


@pytest.mark.slow
def test_push_along_the_river_does_not_speed_up_the_clip_which_catches_up(walk: RiverClips) -> None:
    played = _played(walk, _bumped_phases(5.0))
    after = slice(round(0.8 / PERIOD), None)
    rates = [np.diff(phases[after]) / PERIOD for phases in (played.hand, played.clip)]
    assert rates[0].max() > 1.4
    assert 0.97 < rates[1].min() < rates[1].max() < 1.1
    lag = (played.hand - played.clip)[after]
    assert 0.5 * LEAD < lag.max() < LEAD
    assert lag[-1] == pytest.approx(0.0, abs=2e-3)


def test_velocity_and_acceleration_are_those_of_the_shown_motion(walk: RiverClips) -> None:
    played = _played(walk, _bumped_phases(1.6))
    # While all of the excess is compensated; later the stylus filter's prediction of a pushed hand is wrong anyway.
    pushed = slice(round((PUSHED + 0.04) / PERIOD), round((PUSHED + 0.1) / PERIOD))
    assert (np.diff(played.hand)[pushed] / PERIOD).max() > 1.5
    difference = np.gradient(played.velocity[:, :3], PERIOD, axis=0) - played.acceleration[:, :3]
    assert np.abs(difference[pushed]).max() < 0.3  # [m/s²]


@pytest.mark.slow
def test_clip_follows_a_faster_hand_with_a_lag_and_stops_with_it(walk: RiverClips) -> None:
    t = np.arange(round(6.0 / PERIOD)) * PERIOD
    fast = _played(walk, np.where(t < 1.0, t, 1.0 + 1.3 * (t - 1.0)))
    assert np.diff(fast.clip)[-500:].mean() / PERIOD == pytest.approx(1.3, abs=0.02)
    assert (fast.hand - fast.clip).max() < 0.3
    stopped = _played(walk, np.minimum(t, 2.0))
    assert np.abs((stopped.hand - stopped.clip)[round(0.5 / PERIOD) :]).max() < 0.03
    assert np.abs(stopped.velocity[-1]).max() < 1e-3
