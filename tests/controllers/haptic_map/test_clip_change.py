"""Prepared changes from clip to clip: the pose at the gate and after it, its Jacobian, and validation."""

from itertools import pairwise

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.clip_change import FPS, LEAD_IN, ClipChange, known_between, packed_changes, passed_gate
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import (
    ACTIVE_RIVER,
    CLIP_PHASE,
    LEAD,
    TIMING_RIVER,
    TRANSITION,
    begin_change,
    change_clip,
    follow_other_curve,
    gate_passed,
    has_transition,
    stop_clip,
)
from tests.controllers.clips_for_maps import LEG, difference, swinging
from tests.derivatives import central_differences

LAP, GATE, DURATION = 4.0, 1.0, 1.5
CURVES = [Trajectory.circle(0.05, LAP), Trajectory.circle(0.05, LAP, wave=0.01)]
MAP_WITHOUT_CHANGES = RiverClips(CURVES, [(swinging(1, travel=1.3), 30.0), (swinging(2, turns=1.0), 30.0)], 0.02, [LEG])
SIZE = 3 + 3 * ((MAP_WITHOUT_CHANGES.nq - 3) // 4)


def _offsets() -> np.ndarray:
    """Random offsets that decay within the time of the change, with three continuous derivatives."""
    s = np.arange(round((DURATION + LEAD_IN) * FPS) + 1) / FPS - LEAD_IN
    decay = np.clip(1.0 - s / DURATION, 0.0, None) ** 4
    direction = np.random.default_rng(3).normal(scale=0.4, size=SIZE)
    return decay[:, None] * (direction + 0.2 * np.sin(3.0 * s[:, None] + np.arange(SIZE)))


OFFSETS = _offsets()
MAP = MAP_WITHOUT_CHANGES.with_changes([ClipChange(0, 1, np.array([GATE, 3.0]), OFFSETS)])


def _stylus(curve: int, phase: float) -> np.ndarray:
    return np.concatenate([CURVES[curve].point(phase), [1.0, 0.0, 0.0, 0.0]])


def _memory(phase: float, changing: bool = True) -> np.ndarray:
    memory = MAP.compiled().memory.copy()
    change_clip(MAP.compiled().params, memory, 1.0, phase)
    if changing:
        begin_change(memory, 1.0, 0, GATE)
    return memory


def test_changing_pose_is_the_second_clip_moved_by_the_offset_and_ends_as_that_clip() -> None:
    for elapsed in (-0.05, 0.0, 0.3, 1.0, DURATION - 1e-6):
        phase = GATE + elapsed
        row = (elapsed + LEAD_IN) * FPS
        offset = OFFSETS[int(row)] + (row - int(row)) * (
            OFFSETS[min(int(row) + 1, len(OFFSETS) - 1)] - OFFSETS[int(row)]
        )
        second = MAP_WITHOUT_CHANGES.pose(_stylus(1, phase), _memory(phase, False))
        shown = MAP.pose(_stylus(1, phase), _memory(phase))
        away = difference(shown, second)
        # The root's displacement in its own frame.
        away[:3] = _inversely_rotated(second[3:7], away[:3])
        np.testing.assert_allclose(away, offset, atol=2e-3)
    memory = _memory(GATE + DURATION)
    np.testing.assert_allclose(
        MAP.pose(_stylus(1, GATE + DURATION + 0.01), memory),
        MAP_WITHOUT_CHANGES.pose(_stylus(1, GATE + DURATION + 0.01), _memory(GATE + DURATION, False)), atol=1e-12,
    )  # fmt: skip
    assert memory[TRANSITION] == -1.0


def _inversely_rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    w, u = q[0], -q[1:]
    return v + 2.0 * w * np.cross(u, v) + 2.0 * np.cross(u, np.cross(u, v))


def test_jacobian_during_a_change_matches_finite_differences() -> None:
    for elapsed, ahead in ((0.2, 0.0), (0.9, 0.08), (1.3, -0.1)):
        p = CURVES[1].point(GATE + elapsed) + np.array([1e-3, -2e-3, 1e-3])

        def arguments_at(
            point: np.ndarray, elapsed: float = elapsed, ahead: float = ahead
        ) -> tuple[np.ndarray, np.ndarray]:
            memory = _memory(GATE + elapsed)
            memory[LEAD] = ahead
            return np.concatenate([point, [1.0, 0.0, 0.0, 0.0]]), memory

        jacobian = MAP.jacobian(*arguments_at(p))
        assert np.abs(jacobian[:, :3]).max() > 1.0
        numeric = central_differences(
            lambda point, arguments_at=arguments_at: MAP.pose(*arguments_at(point)), p, 1e-6, difference
        )
        np.testing.assert_allclose(jacobian[:, :3], numeric, atol=2e-5 * np.abs(jacobian).max())
        np.testing.assert_array_equal(jacobian[:, 3:], 0.0)


def test_gate_is_passed_once_per_lap_also_over_the_seam() -> None:
    changes = packed_changes([ClipChange(0, 1, np.array([0.0, 2.5]), OFFSETS), ClipChange(0, 1, [1.2], OFFSETS)])
    phases = np.arange(0.05, 9.0, 0.03)
    passed = [(passed_gate(changes, 0.0, 1.0, a % LAP, b % LAP, LAP), b) for a, b in pairwise(phases.tolist())]
    found = [(k, gate) for (k, gate), _ in passed if k >= 0]
    assert found == [(1, 1.2), (0, 2.5), (0, 0.0), (1, 1.2), (0, 2.5), (0, 0.0)]
    for (k, gate), now in passed:
        if k >= 0:
            assert 0.0 <= (now - gate) % LAP < 0.03
    # Not backwards, and not between other rivers.
    assert passed_gate(changes, 0.0, 1.0, 1.21, 1.19, LAP)[0] == -1
    assert passed_gate(changes, 1.0, 0.0, 1.19, 1.21, LAP)[0] == -1
    assert known_between(changes, 0.0, 1.0)
    assert not known_between(changes, 1.0, 0.0)


def test_clip_timed_by_another_river_continues_smoothly_and_catches_up_with_the_hand() -> None:
    params, memory = MAP.compiled().params, MAP.compiled().memory.copy()
    times = np.arange(0.3, 3.5, 0.01)
    change_clip(params, memory, 1.0, times[0])
    shown = []
    for t in times:
        # The hand is on the level river, below or above the wave whose clip plays.
        x = _stylus(0, t)
        MAP.pose(x, memory)
        shown.append(memory[CLIP_PHASE])
        if memory[TIMING_RIVER] == 1.0 and t > 0.7:
            before = memory[CLIP_PHASE]
            follow_other_curve(params, memory, 0.0, x[:3].copy(), before)
            assert abs(memory[LEAD]) > 0.005
            MAP.pose(x, memory)
            assert memory[CLIP_PHASE] == pytest.approx(before, abs=1e-9)
    assert memory[ACTIVE_RIVER] == 1.0
    assert np.abs(np.diff(shown) - 0.01).max() < 0.006  # the pace of a hand beside the wave
    assert shown[-1] == pytest.approx(times[-1], abs=1e-6)
    assert memory[LEAD] == 0.0


def test_stopped_clip_has_no_known_change_and_a_stop_ends_a_change() -> None:
    params, memory = MAP.compiled().params, MAP.compiled().memory.copy()
    change_clip(params, memory, 0.0, 0.5)
    assert has_transition(params, memory, 1.0)
    assert has_transition(params, memory, 0.0)
    stop_clip(params, memory, 0.0)
    assert not has_transition(params, memory, 1.0)
    memory = _memory(GATE)
    assert not has_transition(params, memory, 0.0)
    stop_clip(params, memory, 0.0)
    assert memory[TRANSITION] == -1.0
    assert gate_passed(params, memory, 0.0) == (-1, 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (ClipChange(0, 2, np.array([1.0]), OFFSETS), "from river 0 to 2 is not between two of 2 rivers"),
        (ClipChange(1, 1, np.array([1.0]), OFFSETS), "from river 1 to 1 is not between two of 2 rivers"),
        (ClipChange(0, 1, np.zeros(0), OFFSETS), "has 0 gates"),
        (ClipChange(0, 1, np.array([1.0]), OFFSETS[:, 1:]), "gates and offsets"),
        (ClipChange(0, 1, np.array([1.0]), np.zeros((400, SIZE))), "lasts 3.2[23] s of a round of 4.00 s"),
        (ClipChange(0, 1, np.array([1.0]), OFFSETS[:5]), "lasts -0.07 s"),
    ],
)
def test_invalid_changes_raise_parameter_error(change: ClipChange, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        MAP_WITHOUT_CHANGES.with_changes([change])


def test_change_between_rivers_of_different_laps_raises_parameter_error() -> None:
    clips = [(swinging(1, travel=1.3), 30.0), (swinging(2, turns=1.0), 30.0)]
    rivers = RiverClips([CURVES[0], Trajectory.circle(0.05, 5.0)], clips, 0.02, [LEG])
    with pytest.raises(ParameterError, match=r"between laps of 4\.0 and 5\.0 s"):
        rivers.with_changes([ClipChange(0, 1, np.array([1.0]), OFFSETS)])
