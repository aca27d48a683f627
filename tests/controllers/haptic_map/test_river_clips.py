"""Rivers that play clips: which clip, which frame, its derivative, and where the figure stands after a change."""

from itertools import pairwise

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import (
    PHASE,
    RIVER,
    change_clip,
    heading_between,
    lets_go,
    phase_rate,
    place_clip,
    stop_clip,
    takes_over,
)
from tests.controllers.clips_for_maps import LEG, difference, matrices, swinging

CLIPS = [(swinging(1, travel=1.3), 30.0), (swinging(2, turns=1.0), 30.0)]
RNG = np.random.default_rng(5)
BESIDE = np.array([0.0, 0.002, 0.0])


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


def test_a_lap_of_the_river_is_a_lap_of_its_clip() -> None:
    memory = _memory(0)
    for k in range(0, 121, 8):
        pose = MAP.pose(_stylus(CURVES[0].point(4.0 * k / 120.0) * 1.1), memory)
        expected = CLIPS[0][0][k % 120, 7:]
        np.testing.assert_allclose(matrices(pose[7:].reshape(-1, 4)), matrices(expected.reshape(-1, 4)), atol=1e-6)


def test_a_round_of_laps_is_a_lap_of_the_clip_and_back_again() -> None:
    """A hand that goes round three times, and back, sees what one that goes round once sees; also at a crossing."""
    rounds = RiverClips(CURVES, CLIPS, 0.02, [LEG], laps=3)
    for river, curve in enumerate(CURVES):
        memories = [_memory(river, 0.1), rounds.compiled().memory.copy()]
        change_clip(rounds.compiled().params, memories[1], float(river), 0.3)
        way = np.linspace(0.1, 4.3, 253)
        for t in (*way, *way[::-1]):
            once = MAP.pose(_stylus(curve.point(t)), memories[0])
            thrice = rounds.pose(_stylus(curve.point(3.0 * t)), memories[1])
            np.testing.assert_allclose(difference(thrice, once), 0.0, atol=1e-7)
        p = curve.point(5.1) + BESIDE
        away = [
            rounds.jacobian(_stylus(p), _begun(rounds, river, 5.1))[:, :3],
            np.stack(
                [
                    difference(*(rounds.pose(_stylus(p + s * step), _begun(rounds, river, 5.1)) for s in (1.0, -1.0)))
                    for step in 1e-6 * np.eye(3)
                ],
                axis=1,
            )
            / 2e-6,
        ]
        np.testing.assert_allclose(*away, atol=2e-5 * np.abs(away[0]).max())


def _begun(made: RiverClips, river: int, phase: float) -> np.ndarray:
    """Memory of a hand that is at a phase of the round."""
    memory = made.compiled().memory.copy()
    change_clip(made.compiled().params, memory, float(river), phase)
    return memory


def test_a_clip_begins_in_the_lap_of_the_round_that_the_hand_is_in() -> None:
    params = RiverClips(CURVES, CLIPS, 0.02, [LEG], laps=3).compiled().params
    for last, there, expected in ((0.2, 3.9, 11.9), (6.1, 2.2, 6.2), (11.9, 0.1, 0.1), (9.0, 0.5, 8.5)):
        memory = _memory(0)
        memory[PHASE] = last
        change_clip(params, memory, 1.0, there)
        assert memory[PHASE] == pytest.approx(expected, abs=1e-12)


def test_a_river_that_crosses_itself_keeps_its_frame_at_the_crossing() -> None:
    memory = _memory(1, 1.9)
    steps = []
    last = MAP.pose(_stylus(CURVES[1].point(1.9)), memory)
    for t in np.linspace(1.9, 2.1, 41)[1:]:
        # A hand that is a little off, on either side.
        pose = MAP.pose(_stylus(CURVES[1].point(t) + BESIDE), memory)
        steps.append(np.abs(difference(pose, last)).max())
        last = pose
    assert max(steps) < 0.15
    # Without what was before, the nearest point of all counts: it is on the other branch half of the time.
    lost = [MAP.pose(_stylus(CURVES[1].point(t) + BESIDE), _memory(1)) for t in np.linspace(1.9, 2.1, 41)]
    jumps = [np.abs(difference(b, a)).max() for a, b in pairwise(lost)]
    assert max(jumps) > 0.3


def test_the_derivative_is_that_of_the_pose() -> None:
    for river in (0, 1):
        for t in (0.3, 1.1, 3.3):
            p = CURVES[river].point(t) + RNG.normal(size=3) * 0.003
            jacobian = MAP.jacobian(_stylus(p), _memory(river, t))
            for k in range(3):
                step = np.zeros(3)
                step[k] = 1e-6
                ends = [MAP.pose(_stylus(p + sign * step), _memory(river, t)) for sign in (1.0, -1.0)]
                np.testing.assert_allclose(jacobian[:, k], difference(*ends) / 2e-6, atol=2e-5 * np.abs(jacobian).max())
            np.testing.assert_array_equal(jacobian[:, 3:], 0.0)


def test_a_clip_is_placed_where_the_figure_stands_and_faces() -> None:
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


def test_no_river_and_none_that_there_is_not_take_over() -> None:
    params = MAP.compiled().params
    memory = _memory(0)
    assert [takes_over(params, memory, river) for river in (-1.0, 0.0, 1.0, 2.0, np.nan)] == [0, 0, 1, 0, 0]
    assert memory[RIVER] == 0.0


def test_a_hand_outside_the_tube_is_let_go_once_and_has_no_frame_then() -> None:
    params, memory = MAP.compiled().params, _memory(0, 1.0)
    inside, outside = CURVES[0].point(1.0) * 1.3, CURVES[0].point(1.0) * 1.5
    along = CURVES[0].velocity(1.0)

    def _goes(p: np.ndarray, rate: float, gain: float = 0.0, river: float = -1.0) -> bool:
        """Whether a hand at p that goes at a rate of the river's pace, and gains so much of it a second, is let go."""
        return lets_go(params, memory, river, np.stack([p, rate * along, gain * along]), rate)

    assert [_goes(p, 1.0, 0.0, river) for river in (-1.0, 0.0) for p in (inside, outside)] == [0, 1, 0, 0]
    # One that races along in the tube plays no clip either, whichever way, nor one that soon will.
    assert [_goes(inside, rate, 0.0, river) for river in (-1.0, 0.0) for rate in (3.0, -3.0)] == [1, 1, 0, 0]
    assert [_goes(inside, 1.0, gain) for gain in (10.0, 100.0, -20.0, -200.0)] == [0, 1, 0, 1]
    # Near the centre of the curve's bend its pace is no pace.
    assert [_goes(CURVES[0].point(1.0) * share, 0.0) for share in (0.8, 0.9)] == [0, 0]
    stop_clip(params, memory, 0.25)
    stopped = MAP.pose(_stylus(outside), memory)
    np.testing.assert_array_equal(MAP.pose(_stylus(CURVES[0].point(3.0)), memory), stopped)
    np.testing.assert_array_equal(MAP.jacobian(_stylus(outside), memory), 0.0)
    expected = MAP.pose(_stylus(CURVES[0].point(1.25)), _memory(0, 1.25))
    np.testing.assert_allclose(stopped, expected, atol=1e-9)
    assert not _goes(outside, 1.0)
    # Its own river takes it from none.
    assert takes_over(params, memory, 0.0)
    change_clip(params, memory, 0.0, 3.0)
    assert not takes_over(params, memory, 0.0)


def test_a_clip_stops_at_the_phase_of_rest_nearest_to_where_it_would_over_the_seam_too() -> None:
    lap = CURVES[0].duration
    resting = MAP.with_rests([np.array([0.2, 0.55 * lap]), np.zeros(0)])
    params = resting.compiled().params
    for river, phase, way, expected in (
        (0, 0.5 * lap, 0.1, 0.55 * lap), (0, 0.97 * lap, 0.0, 0.2), (0, 0.97 * lap, 0.03 * lap, 0.2),
        (1, 1.0, 0.25, 1.25),
    ):  # fmt: skip
        memory = _memory(river, phase)
        stop_clip(params, memory, way)
        assert memory[PHASE] == pytest.approx(expected, abs=1e-12)
    # Nothing else of the map changes.
    x = _stylus(CURVES[0].point(1.0))
    np.testing.assert_array_equal(resting.pose(x), MAP.pose(x))
    for rests in ([np.zeros(1)], [np.array([np.nan]), np.zeros(0)]):
        with pytest.raises(ParameterError, match="phases of rest"):
            MAP.with_rests(rests)


def test_the_pace_of_a_hand_is_told_over_the_seam() -> None:
    params, lap = MAP.compiled().params, CURVES[0].duration
    for here, there in ((1.0, 1.02), (lap - 0.01, 0.01)):
        assert phase_rate(params, _memory(0, here), _memory(0, there), 0.01) == pytest.approx(2.0)
        assert phase_rate(params, _memory(0, there), _memory(0, here), 0.01) == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ("curves", "clips", "tube", "says"),
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
def test_what_makes_no_map_of_rivers_is_refused(curves, clips, tube, says) -> None:
    with pytest.raises(ParameterError, match=says):
        RiverClips(curves, clips, tube)


def test_a_round_without_a_lap_is_refused() -> None:
    with pytest.raises(ParameterError, match="one lap or more, got 0"):
        RiverClips(CURVES, CLIPS, 0.02, laps=0)
