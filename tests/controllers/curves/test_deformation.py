"""Deformation of a curve: exact at the hand, local, closed curves stay closed, undo is exact."""

from pathlib import Path

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.curves import deformation
from controllers.curves.closest_point import closest_phases
from controllers.curves.deformation import begin_edit, bump, commit, discard_edit, drag_to, redo, undo
from controllers.curves.editing import curve_of, record_of, refine
from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError

casadi.GlobalOptions.setNumpyMode(1)
WIDTH = 0.5
PHASES = np.linspace(0.0, 4.0, 1601)


def _circle() -> Trajectory:
    return Trajectory.circle(0.05, 4.0)


def _uneven(periodic: bool, n: int = 15) -> Trajectory:
    """A curve with unequal time steps and a turning stylus."""
    rng = np.random.default_rng(n)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 0.5, n))])
    times *= 4.0 / times[-1]
    angle = 0.5 * np.pi * times
    positions = 0.04 * np.stack([np.cos(angle), np.sin(angle), 0.3 * np.sin(3 * angle)], axis=1)
    quaternions = np.stack([np.cos(0.3 * np.sin(angle)), 0 * angle, 0 * angle, np.sin(0.3 * np.sin(angle))], axis=1)
    if periodic:
        positions[-1], quaternions[-1] = positions[0], quaternions[0]
    else:
        positions[:, 2] += 0.01 * times
    return Trajectory(times, positions, quaternions, periodic)


CURVES = {"circle": _circle(), "uneven closed": _uneven(True), "uneven open": _uneven(False)}


@pytest.fixture(params=CURVES.values(), ids=CURVES.keys())
def curve(request: pytest.FixtureRequest) -> Trajectory:
    return request.param


def _record(curve: Trajectory, depth: int = 64) -> np.ndarray:
    record = record_of(curve, WIDTH, depth)
    discard_edit(record, 0)  # also updates the bounds of the segments, as after every edit
    return record


def _edited(curve: Trajectory, phase: float, delta: list[float]) -> np.ndarray:
    record = _record(curve)
    assert begin_edit(record, 0, phase)
    drag_to(record, 0, *(curve.point(phase) + delta))
    commit(record, 0)
    return record


def _blob(record: np.ndarray) -> np.ndarray:
    return record[deformation.work_curve(record, 0) :]


def test_bump_is_one_at_its_centre_compact_and_twice_differentiable() -> None:
    s = np.linspace(-1.2, 1.2, 2401)
    w = np.array([bump(x) for x in s])
    assert bump(0.0) == 1.0
    assert (w[np.abs(s) >= 1.0] == 0.0).all()
    second = np.diff(w, 2) / 1e-6
    # A cubic of |w‴| ≤ 36: its second derivative moves by no more than 36 ds a step, also across its knots.
    assert np.abs(np.diff(second)).max() < 36.0 * 1e-3 + 1e-4
    symbol = casadi.SX.sym("s")
    symbolic = casadi.Function("w", [symbol], [bump.py_func(symbol)])
    for x in s[::100]:
        assert float(symbolic(x)) == pytest.approx(bump(x), abs=1e-15)


def test_refined_curve_equals_the_original(curve: Trajectory) -> None:
    fine = refine(curve, 100)
    assert len(fine.coefficients) > len(curve.coefficients)
    for name in ("point", "velocity", "acceleration", "orientation"):
        np.testing.assert_allclose(getattr(fine, name)(PHASES), getattr(curve, name)(PHASES), atol=1e-12)


@settings(max_examples=25)
@given(st.floats(0.0, 4.0), st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_grabbed_point_follows_the_hand_and_the_rest_stays(phase: float, delta: tuple) -> None:
    for curve in (CURVES["circle"], CURVES["uneven closed"]):
        record = _record(curve)
        before = curve_of(record, 0, curve)
        p = curve.point(phase) + delta
        assert begin_edit(record, 0, phase)
        drag_to(record, 0, *p)
        bent = curve_of(record, 0, curve)
        assert np.abs(bent.point(phase) - p).max() < 1e-12
        away = np.abs((PHASES - phase + 2.0) % 4.0 - 2.0)
        # Half a step of the grid beside the phase, and half width rounded to the grid: within h/8 of h.
        outside = away > 1.125 * WIDTH
        np.testing.assert_array_equal(bent.point(PHASES[outside]), before.point(PHASES[outside]))
        np.testing.assert_array_equal(bent.orientation(PHASES), before.orientation(PHASES))


def test_deformation_is_the_documented_sum_of_bumps(curve: Trajectory) -> None:
    record, bends = _record(curve), []
    for phase, delta in ((1.0, [0.01, 0.0, 0.0]), (1.2, [0.0, -0.02, 0.01]), (2.9, [0.0, 0.0, 0.03])):
        assert begin_edit(record, 0, phase)
        drag_to(record, 0, *(curve_of(record, 0, curve).point(phase) + delta))
        centre, width, *weighted = record[deformation.PENDING : deformation.RECORD_HEADER]
        assert abs(centre - phase) <= WIDTH / 32 + 1e-12
        assert width == pytest.approx(WIDTH, rel=1 / 16)
        np.testing.assert_allclose(np.array(weighted) * bump((phase - centre) / width), delta, atol=1e-15)
        bends.append((centre, width, np.array(weighted)))
        commit(record, 0)
    expected = curve.point(PHASES) + sum(
        np.array([bump((t - centre) / width) for t in PHASES])[:, None] * weighted for centre, width, weighted in bends
    )
    np.testing.assert_allclose(curve_of(record, 0, curve).point(PHASES), expected, atol=1e-14)


def test_closed_curve_stays_closed_and_any_curve_stays_smooth(curve: Trajectory) -> None:
    phase = 3.95 if curve.periodic else 0.3
    bent = curve_of(_edited(curve, phase, [0.02, 0.01, -0.02]), 0, curve)
    breaks = np.asarray(bent.times)[1:-1]
    for name in ("point", "velocity", "acceleration"):
        value = getattr(bent, name)
        np.testing.assert_allclose(value(breaks - 1e-13), value(breaks), atol=1e-8)
        if curve.periodic:
            np.testing.assert_allclose(value(4.0 - 1e-13), value(0.0), atol=1e-8)
    if curve.periodic:
        # The bump lies on both sides of the seam.
        assert np.linalg.norm(bent.point(0.1) - curve.point(0.1)) > 5e-3
        assert np.linalg.norm(bent.point(3.9) - curve.point(3.9)) > 5e-3


def test_open_ends_keep_position_slope_and_curvature() -> None:
    curve = CURVES["uneven open"]
    for phase in (0.2, 0.45, 3.6):
        bent = curve_of(_edited(curve, phase, [0.02, 0.02, 0.02]), 0, curve)
        for name in ("point", "velocity", "acceleration"):
            for end in (0.0, 4.0):
                np.testing.assert_allclose(getattr(bent, name)(end), getattr(curve, name)(end), atol=1e-9)
    assert not begin_edit(_record(curve), 0, 0.05)


def test_undo_and_redo_are_exact(curve: Trajectory) -> None:
    rng = np.random.default_rng(3)
    record = _record(curve)
    history = [_blob(record).copy()]
    for phase in (0.6, 2.0, 2.2, 3.4):
        assert begin_edit(record, 0, phase)
        for _ in range(5):
            drag_to(record, 0, *(curve_of(record, 0, curve).point(phase) + rng.normal(size=3) * 0.01))
        commit(record, 0)
        history.append(_blob(record).copy())
    for state in reversed(history[:-1]):
        assert undo(record, 0)
        np.testing.assert_array_equal(_blob(record), state)
    assert not undo(record, 0)
    for state in history[1:]:
        assert redo(record, 0)
        np.testing.assert_array_equal(_blob(record), state)
    assert not redo(record, 0)


def test_discarded_edit_leaves_no_trace_and_a_new_edit_clears_redo() -> None:
    record = _edited(_circle(), 1.0, [0.01, 0.0, 0.0])
    state = _blob(record).copy()
    assert begin_edit(record, 0, 1.1)
    drag_to(record, 0, 0.0, 0.0, 0.05)
    assert not np.array_equal(_blob(record), state)
    discard_edit(record, 0)
    np.testing.assert_array_equal(_blob(record), state)
    undo(record, 0)
    assert begin_edit(record, 0, 3.0)
    drag_to(record, 0, 0.0, -0.06, 0.0)
    commit(record, 0)
    assert not redo(record, 0)


def test_edits_beyond_the_depth_cannot_be_undone() -> None:
    deep, shallow = _record(_circle()), _record(_circle(), depth=2)
    for k, phase in enumerate((0.5, 1.5, 2.5, 3.5, 0.7)):
        for record in (deep, shallow):
            assert begin_edit(record, 0, phase)
            drag_to(record, 0, *(_circle().point(phase) * (1.0 + 0.1 * k)))
            commit(record, 0)
    np.testing.assert_array_equal(_blob(deep), _blob(shallow))
    assert [undo(shallow, 0) for _ in range(3)] == [True, True, False]
    assert [undo(deep, 0) for _ in range(2)] == [True, True]
    np.testing.assert_array_equal(_blob(deep), _blob(shallow))


def test_closest_point_is_exact_on_a_curve_being_bent(curve: Trajectory) -> None:
    rng = np.random.default_rng(4)
    record = _record(curve)
    for phase in (0.4, 1.7, 3.5):
        assert begin_edit(record, 0, phase)
        drag_to(record, 0, *(curve.point(phase) + rng.normal(size=3) * 0.03))
        points = rng.normal(size=(60, 3)) * 0.05
        _, distances = closest_phases(_blob(record), points)
        # The bounds in the record are not the tight ones of `packed`, yet must find the same.
        _, tight = closest_phases(curve_of(record, 0, curve).packed(), points)
        np.testing.assert_allclose(distances, tight, atol=2e-11)
        dense = curve_of(record, 0, curve).point(np.linspace(0.0, 4.0, 8001))
        nearest = np.linalg.norm(dense[None] - points[:, None], axis=2).min(axis=1)
        assert (distances <= nearest + 1e-12).all()
        assert (distances >= nearest - 1e-6).all()
        commit(record, 0)


def test_curve_read_back_has_the_coefficients_of_the_servo() -> None:
    curve = CURVES["uneven closed"]
    record = _edited(curve, 1.0, [0.01, 0.01, 0.0])
    blob, packed = _blob(record), curve_of(record, 0, curve).packed()
    rows = slice(int(packed[6]), int(packed[8]))
    np.testing.assert_array_equal(packed[rows], blob[rows])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: record_of(_circle(), 0.0, 64), "above 0 s"),
        (lambda: record_of(_circle(), 2.1, 64), "at most half of the curve's 4 s, got 2.1"),
        (lambda: record_of(_circle(), np.nan, 64), "nan"),
        (lambda: record_of(_circle(), 3e-4, 64), "half width of 0.0003 s; expected 0.0004 s or more"),
        (lambda: record_of(_circle(), 0.5, 0), "from 1 to 10000 edits"),
        (lambda: record_of(_circle(), 0.5, 10**12), "from 1 to 10000 edits"),
    ],
)
def test_invalid_records_raise_curve_error(make, message) -> None:
    with pytest.raises(CurveError, match=message):
        make()


def test_documentation_example_runs() -> None:
    page = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "stretchy-tubes.md"
    text = page.read_text(encoding="utf-8")
    names: dict = {}
    exec(text.split("```python\n")[1].split("```")[0], names)
    np.testing.assert_allclose(names["bent"].point(1.0), [0.0, 0.07, 0.01], atol=1e-12)
    np.testing.assert_allclose(curve_of(names["record"], 0, names["circle"]).point(1.0), [0.0, 0.05, 0.0], atol=1e-12)
