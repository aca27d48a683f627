"""Rivers that play clips: selection of clip and frame, the Jacobian, and the figure's position after a change."""

from itertools import pairwise

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import (
    ACTIVE_RIVER,
    HAND_PHASE,
    change_clip,
    has_left_river,
    heading_between,
    is_taken_over,
    phase_rate,
    place_clip,
    stop_clip,
)
from tests.controllers.clips_for_maps import LEG, difference, matrices, swinging
from tests.derivatives import central_differences

CLIPS = [(swinging(1, travel=1.3), 30.0), (swinging(2, turns=1.0), 30.0)]
RNG = np.random.default_rng(5)
OFFSET = np.array([0.0, 0.002, 0.0])


def _eight() -> Trajectory:
    angle = np.linspace(0.0, 2.0 * np.pi, 129)
    points = np.stack((0.06 * np.sin(angle), 0.03 * np.sin(2.0 * angle), np.zeros(129)), axis=1)
    points[-1] = points[0]
    return Trajectory(4.0 * angle / (2.0 * np.pi), points, periodic=True)


CURVES = [Trajectory.circle(0.05, 4.0), _eight()]
MAP = RiverClips(CURVES, CLIPS, 0.02, [LEG])


def _stylus(p: np.ndarray) -> np.ndarray:
    return np.concatenate([p, [1.0, 0.0, 0.0, 0.0]])


def _memory(river: int, phase: float = np.nan) -> np.ndarray:
    memory = MAP.compiled().memory.copy()
    change_clip(MAP.compiled().params, memory, float(river), phase)
    return memory


def test_lap_of_the_river_plays_one_lap_of_its_clip() -> None:
    memory = _memory(0)
    for k in range(0, 121, 8):
        pose = MAP.pose(_stylus(CURVES[0].point(4.0 * k / 120.0) * 1.1), memory)
        expected = CLIPS[0][0][k % 120, 7:]
        np.testing.assert_allclose(matrices(pose[7:].reshape(-1, 4)), matrices(expected.reshape(-1, 4)), atol=1e-6)


def test_round_of_laps_plays_one_lap_of_the_clip_forwards_and_backwards() -> None:
    """Three times round a river of three-lap rounds equals once round one of single laps, also at a crossing."""
    rounds = RiverClips(CURVES, CLIPS, 0.02, [LEG], laps=3)
    for river, curve in enumerate(CURVES):
        memories = [_memory(river, 0.1), rounds.compiled().memory.copy()]
        change_clip(rounds.compiled().params, memories[1], float(river), 0.3)
        phases = np.linspace(0.1, 4.3, 253)
        for t in (*phases, *phases[::-1]):
            once = MAP.pose(_stylus(curve.point(t)), memories[0])
            thrice = rounds.pose(_stylus(curve.point(3.0 * t)), memories[1])
            np.testing.assert_allclose(difference(thrice, once), 0.0, atol=1e-7)
        p = curve.point(5.1) + OFFSET
        jacobian = rounds.jacobian(_stylus(p), _memory_at(rounds, river, 5.1))[:, :3]
        pose_at = lambda p, river=river: rounds.pose(_stylus(p), _memory_at(rounds, river, 5.1))  # noqa: E731
        numeric = central_differences(pose_at, p, 1e-6, difference)
        np.testing.assert_allclose(jacobian, numeric, atol=2e-5 * np.abs(jacobian).max())


def _memory_at(rivers: RiverClips, river: int, phase: float) -> np.ndarray:
    """Memory of a map whose hand is at a phase of the round."""
    memory = rivers.compiled().memory.copy()
    change_clip(rivers.compiled().params, memory, float(river), phase)
    return memory


def test_clip_begins_in_the_lap_of_the_round_nearest_to_the_hand() -> None:
    params = RiverClips(CURVES, CLIPS, 0.02, [LEG], laps=3).compiled().params
    for last, there, expected in ((0.2, 3.9, 11.9), (6.1, 2.2, 6.2), (11.9, 0.1, 0.1), (9.0, 0.5, 8.5)):
        memory = _memory(0)
        memory[HAND_PHASE] = last
        change_clip(params, memory, 1.0, there)
        assert memory[HAND_PHASE] == pytest.approx(expected, abs=1e-12)


def test_self_crossing_river_keeps_its_branch_at_the_crossing() -> None:
    memory = _memory(1, 1.9)
    steps = []
    last = MAP.pose(_stylus(CURVES[1].point(1.9)), memory)
    for t in np.linspace(1.9, 2.1, 41)[1:]:
        # The hand is 2 mm off the curve.
        pose = MAP.pose(_stylus(CURVES[1].point(t) + OFFSET), memory)
        steps.append(np.abs(difference(pose, last)).max())
        last = pose
    assert max(steps) < 0.15
    # Without memory the globally nearest point counts, which is on the other branch half of the time.
    without_memory = [MAP.pose(_stylus(CURVES[1].point(t) + OFFSET), _memory(1)) for t in np.linspace(1.9, 2.1, 41)]
    jumps = [np.abs(difference(b, a)).max() for a, b in pairwise(without_memory)]
    assert max(jumps) > 0.3


def test_jacobian_matches_finite_differences() -> None:
    for river in (0, 1):
        for t in (0.3, 1.1, 3.3):
            p = CURVES[river].point(t) + RNG.normal(size=3) * 0.003
            jacobian = MAP.jacobian(_stylus(p), _memory(river, t))
            pose_at = lambda p, river=river, t=t: MAP.pose(_stylus(p), _memory(river, t))  # noqa: E731
            numeric = central_differences(pose_at, p, 1e-6, difference)
            np.testing.assert_allclose(jacobian[:, :3], numeric, atol=2e-5 * np.abs(jacobian).max())
            np.testing.assert_array_equal(jacobian[:, 3:], 0.0)


def test_clip_is_placed_at_position_and_heading_of_the_figure() -> None:
    stylus = _stylus(CURVES[1].point(0.7))
    memory = _memory(1, 0.7)
    pose = MAP.pose(stylus, memory)
    before = pose.copy()
    place_clip(memory, pose, 2.0, -1.0, 0.8)
    placed = MAP.pose(stylus, memory)
    np.testing.assert_allclose(placed[:2], [2.0, -1.0], atol=1e-12)
    assert placed[2] == before[2]
    assert heading_between(before, placed) == pytest.approx(0.8, abs=1e-12)
    np.testing.assert_allclose(placed[7:], before[7:], atol=1e-15)


def test_only_another_existing_river_takes_over() -> None:
    params = MAP.compiled().params
    memory = _memory(0)
    assert [is_taken_over(params, memory, river) for river in (-1.0, 0.0, 1.0, 2.0, np.nan)] == [0, 0, 1, 0, 0]
    assert memory[ACTIVE_RIVER] == 0.0


ON_CURVE = CURVES[0].point(1.0)
INSIDE, OUTSIDE = 1.3 * ON_CURVE, 1.5 * ON_CURVE  # of the tube


def _lets_go(memory: np.ndarray, position: np.ndarray, rate: float, gain: float, river: float) -> bool:
    """Whether the clip of river 0 lets go of a hand while `river` (−1: none) is active.

    The hand moves along the curve at `rate` times its pace and accelerates by `gain` times the pace a second.
    """
    along = CURVES[0].velocity(1.0)
    return has_left_river(MAP.compiled().params, memory, river, np.stack([position, rate * along, gain * along]), rate)


@pytest.mark.parametrize(
    ("position", "rate", "gain", "river", "expected"),
    [
        # Outside the tube, unless a river is active.
        (INSIDE, 1.0, 0.0, -1.0, False),
        (OUTSIDE, 1.0, 0.0, -1.0, True),
        (INSIDE, 1.0, 0.0, 0.0, False),
        (OUTSIDE, 1.0, 0.0, 0.0, False),
        # Much faster than the river in either direction.
        (INSIDE, 3.0, 0.0, -1.0, True),
        (INSIDE, -3.0, 0.0, -1.0, True),
        (INSIDE, 3.0, 0.0, 0.0, False),
        (INSIDE, -3.0, 0.0, 0.0, False),
        # Soon much faster by its acceleration.
        (INSIDE, 1.0, 10.0, -1.0, False),
        (INSIDE, 1.0, 100.0, -1.0, True),
        (INSIDE, 1.0, -20.0, -1.0, False),
        (INSIDE, 1.0, -200.0, -1.0, True),
        # Near the centre of curvature, where the rate of the phase is not defined.
        (0.8 * ON_CURVE, 0.0, 0.0, -1.0, False),
        (0.9 * ON_CURVE, 0.0, 0.0, -1.0, False),
    ],
)
def test_hand_is_let_go_outside_the_tube_or_at_another_pace(
    position: np.ndarray, rate: float, gain: float, river: float, expected: bool
) -> None:
    assert _lets_go(_memory(0, 1.0), position, rate, gain, river) == expected


def _stopped() -> np.ndarray:
    """Memory of a clip that stops 0.25 s after phase 1."""
    memory = _memory(0, 1.0)
    stop_clip(MAP.compiled().params, memory, 0.25)
    return memory


def test_stopped_clip_keeps_its_pose_wherever_the_hand_is() -> None:
    memory = _stopped()
    stopped = MAP.pose(_stylus(OUTSIDE), memory)
    np.testing.assert_array_equal(MAP.pose(_stylus(CURVES[0].point(3.0)), memory), stopped)
    np.testing.assert_array_equal(MAP.jacobian(_stylus(OUTSIDE), memory), 0.0)
    expected = MAP.pose(_stylus(CURVES[0].point(1.25)), _memory(0, 1.25))
    np.testing.assert_allclose(stopped, expected, atol=1e-9)


def test_stopped_clip_is_not_let_go_again() -> None:
    assert not _lets_go(_stopped(), OUTSIDE, 1.0, 0.0, -1.0)


def test_own_river_takes_over_a_stopped_clip_but_not_a_playing_one() -> None:
    params, memory = MAP.compiled().params, _stopped()
    assert is_taken_over(params, memory, 0.0)
    change_clip(params, memory, 0.0, 3.0)
    assert not is_taken_over(params, memory, 0.0)


def test_clip_stops_at_the_nearest_rest_phase_also_over_the_seam() -> None:
    lap = CURVES[0].duration
    resting = MAP.with_rest_phases([np.array([0.2, 0.55 * lap]), np.zeros(0)])
    params = resting.compiled().params
    for river, phase, distance, expected in (
        (0, 0.5 * lap, 0.1, 0.55 * lap), (0, 0.97 * lap, 0.0, 0.2), (0, 0.97 * lap, 0.03 * lap, 0.2),
        (1, 1.0, 0.25, 1.25),
    ):  # fmt: skip
        memory = _memory(river, phase)
        stop_clip(params, memory, distance)
        assert memory[HAND_PHASE] == pytest.approx(expected, abs=1e-12)
    # The rest of the map is unchanged.
    x = _stylus(CURVES[0].point(1.0))
    np.testing.assert_array_equal(resting.pose(x), MAP.pose(x))
    for rests in ([np.zeros(1)], [np.array([np.nan]), np.zeros(0)]):
        with pytest.raises(ParameterError, match="phases of rest"):
            MAP.with_rest_phases(rests)


def test_phase_rate_is_measured_over_the_seam() -> None:
    params, lap = MAP.compiled().params, CURVES[0].duration
    for here, there in ((1.0, 1.02), (lap - 0.01, 0.01)):
        assert phase_rate(params, _memory(0, here), _memory(0, there), 0.01) == pytest.approx(2.0)
        assert phase_rate(params, _memory(0, there), _memory(0, here), 0.01) == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ("curves", "clips", "tube", "message"),
    [
        (CURVES, CLIPS[:1], 0.02, "1 clips and 2 rivers"),
        ([], [], 0.02, "0 rivers"),
        (
            [CURVES[0], Trajectory([0.0, 1.0, 2.0], [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])],
            CLIPS,
            0.02,
            "river 1 is open",
        ),
        (CURVES, CLIPS, 0.0, "tube"),
    ],
)
def test_invalid_arguments_raise_parameter_error(curves, clips, tube, message) -> None:
    with pytest.raises(ParameterError, match=message):
        RiverClips(curves, clips, tube)


def test_round_without_a_lap_raises_parameter_error() -> None:
    with pytest.raises(ParameterError, match="one lap or more, got 0"):
        RiverClips(CURVES, CLIPS, 0.02, laps=0)
