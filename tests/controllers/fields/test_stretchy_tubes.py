"""STRETCHY TUBES: seeking, holding, bending, pushing from outside, undo by clicks, and following the result."""

import casadi
import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError, ParameterError
from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_SIZE
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import evaluate
from controllers.fields.follow import Follow
from controllers.fields.stretchy_tubes import CLICK_TIME, StretchyTubes, stretch_force
from controllers.state import HandState

CIRCLE = Trajectory.circle(0.05, 4.0)
PHASES = np.linspace(0.0, 4.0, 801)
TUBES = StretchyTubes(CIRCLE, k_f=150.0, k_s=200.0, b=0.0, epsilon=0.008, width=0.5)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class Session:
    """A run of a field, tick by tick, with prescribed hand positions."""

    def __init__(self, field: StretchyTubes, program: Program | None = None):
        self.field = field
        self.program = field.program() if program is None else program
        self.memory = self.program.fresh_memory()
        self.time = 0.0

    def at(self, p, switch: bool = False, after: float = 0.001, v=(0.0, 0.0, 0.0)) -> np.ndarray:
        self.time += after
        hand = HandState(self.time, np.array(p, float), UPRIGHT, np.array(v, float), np.zeros(3), switch)
        wrench = np.empty(6)
        evaluate(*self.program.compiled(), self.memory, hand.vector(), wrench)
        assert (wrench[3:] == 0.0).all()
        return wrench[:3]

    def drag(self, start, end, steps: int = 20) -> None:
        for share in np.linspace(0.0, 1.0, steps):
            self.at(np.array(start) * (1.0 - share) + np.array(end) * share, switch=True)
        self.at(end)

    def click(self, p, seconds: float) -> None:
        self.at(p, switch=True)
        self.at(p, switch=True, after=seconds)
        self.at(p)

    @property
    def curve(self) -> Trajectory:
        return self.field.edited(self.memory)

    @property
    def edits(self) -> int:
        return len(self.field.edits(self.memory))


def test_open_switch_pulls_to_the_nearest_point_and_damps() -> None:
    session = Session(StretchyTubes(CIRCLE, k_f=150.0, k_s=200.0, b=3.0))
    p, v = np.array([0.04, 0.06, 0.02]), np.array([0.1, -0.2, 0.3])
    nearest = 0.05 * np.array([0.04, 0.06, 0.0]) / np.hypot(0.04, 0.06)
    np.testing.assert_allclose(session.at(p, v=v), 150.0 * (nearest - p) - 3.0 * v, atol=1e-4)


def test_tube_held_in_the_papers_form_pulls_to_where_the_stylus_was() -> None:
    session = Session(StretchyTubes(CIRCLE, 150.0, 200.0, 14.0, hold="stylus"))
    grasped = CIRCLE.point(1.0) * 1.1
    session.at(grasped)
    np.testing.assert_array_equal(session.at(grasped, switch=True), 0.0)
    np.testing.assert_allclose(session.at(grasped + 0.01, switch=True), -200.0 * 0.01, atol=1e-12)


def test_held_point_follows_the_stylus_and_pulls_back_to_its_origin() -> None:
    session = Session(TUBES)
    start = np.array([0.052, 0.0, 0.001])
    session.at(start)
    session.at(start, switch=True)
    rng = np.random.default_rng(0)
    for _ in range(50):
        p = start + rng.normal(size=3) * 0.02
        force = session.at(p, switch=True)
        np.testing.assert_allclose(force, 200.0 * (np.array([0.05, 0.0, 0.0]) - p), atol=1e-9)
        assert np.linalg.norm(session.curve.point(0.0) - p) < 1e-9
        assert session.memory[TRACE_DISTANCE] < 1e-9
        assert session.memory[TRACE_PHASE] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 <= TUBES.held_off(session.memory) < 1e-9


def test_edit_is_local_and_committed_on_release() -> None:
    session = Session(TUBES)
    session.at([0.0, 0.05, 0.0])
    before = session.curve
    session.drag([0.0, 0.051, 0.0], [0.0, 0.065, 0.02])
    assert session.edits == 1
    outside = np.abs(PHASES - 1.0) > 0.5625
    np.testing.assert_array_equal(session.curve.point(PHASES[outside]), before.point(PHASES[outside]))
    np.testing.assert_allclose(session.curve.point(1.0), [0.0, 0.065, 0.02], atol=1e-9)
    # The hand is on the edited curve, so there is no force.
    np.testing.assert_allclose(session.at([0.0, 0.065, 0.02]), 0.0, atol=1e-9)


def test_short_click_undoes_and_long_click_redoes_exactly() -> None:
    session = Session(TUBES)
    session.at([0.05, 0.0, 0.0])
    on_tube = CIRCLE.point(3.7)
    states = [session.curve.coefficients]
    for phase in (0.5, 1.2, 2.0, 2.9):
        p = session.curve.point(phase)
        session.drag(p, p * 1.2 + [0.0, 0.0, 0.01])
        states.append(session.curve.coefficients)
    for state in reversed(states[:-1]):
        session.click(on_tube, 0.5 * CLICK_TIME)
        np.testing.assert_array_equal(session.curve.coefficients, state)
    session.click(on_tube, 0.5 * CLICK_TIME)
    assert session.edits == 0
    for state in states[1:]:
        session.click(on_tube, 2.0 * CLICK_TIME)
        np.testing.assert_array_equal(session.curve.coefficients, state)
    session.click(on_tube, 2.0 * CLICK_TIME)
    assert session.edits == 4


def test_click_away_from_the_tube_does_nothing() -> None:
    session = Session(TUBES)
    session.at([0.05, 0.0, 0.0])
    session.drag([0.05, 0.0, 0.0], [0.06, 0.0, 0.0])
    session.click([0.0, 0.09, 0.0], 0.1)
    assert session.edits == 1


def test_tube_pushed_from_outside_resists_elastically() -> None:
    session = Session(TUBES)
    untouched = [session.at([0.0, y, 0.0], switch=y < 0.08) for y in (0.08, 0.075, 0.07, 0.0581)]
    np.testing.assert_array_equal(untouched[1:], 0.0)
    for y in (0.0579, 0.055, 0.05, 0.03, 0.04):
        force = session.at([0.0, y, 0.0], switch=True)
        np.testing.assert_allclose(force, [0.0, 200.0 * (0.058 - y), 0.0], atol=1e-3)
        # The tube's surface is at the stylus.
        assert np.linalg.norm(session.curve.point(1.0) - [0.0, y, 0.0]) == pytest.approx(0.008, abs=1e-6)
    assert session.at([0.0, 0.059, 0.0], switch=True)[1] == 0.0
    np.testing.assert_allclose(session.curve.point(PHASES), CIRCLE.point(PHASES), atol=1e-12)
    for y in (0.0579, 0.045, 0.035):
        session.at([0.0, y, 0.0], switch=True)
    session.at([0.0, 0.035, 0.0])
    assert session.edits == 1
    np.testing.assert_allclose(session.curve.point(1.0), [0.0, 0.027, 0.0], atol=1e-6)


def test_force_is_continuous_while_the_switch_is_unchanged() -> None:
    rng = np.random.default_rng(1)
    for switch in (False, True):
        for _ in range(15):
            start, direction = CIRCLE.point(rng.uniform(0, 4)) * rng.uniform(0.9, 1.6), rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            session = Session(TUBES)
            session.at(start)
            for s in np.linspace(0.0, 0.02, 120):
                pair = [session.at(start + (s + d) * direction, switch) for d in (0.0, 1e-12)]
                assert np.abs(pair[1] - pair[0]).max() < 1e-9
    # The force is continuous where a probe touches the tube.
    session = Session(TUBES)
    session.at([0.0, 0.07, 0.0])
    pair = [session.at([0.0, y, 0.0], True) for y in (0.07, 0.058 + 2e-8, 0.058 - 2e-8)]
    assert np.abs(pair[2] - pair[1]).max() < 2e-5


def test_force_is_continuous_over_the_grab_with_equal_stiffnesses() -> None:
    session = Session(StretchyTubes(CIRCLE, 150.0, 150.0))
    p = [0.054, 0.0, 0.002]
    np.testing.assert_allclose(session.at(p, True), session.at(p), atol=1e-12)


def test_fixed_ends_of_an_open_curve_cannot_be_moved() -> None:
    open_curve = Trajectory(np.linspace(0.0, 4.0, 9), np.linspace([-0.05, 0.0, 0.0], [0.05, 0.0, 0.01], 9))
    session = Session(StretchyTubes(open_curve, 150.0, 200.0))
    before = session.curve
    session.drag([-0.05, 0.001, 0.0], [-0.08, 0.03, 0.0])
    np.testing.assert_allclose(session.curve.point(PHASES), before.point(PHASES), atol=0)
    session.drag([0.0, 0.0, 0.005], [0.0, 0.03, 0.005])
    for end in (0.0, 4.0):
        np.testing.assert_array_equal(session.curve.point(end), before.point(end))
    assert session.edits == 1


def test_stretched_curve_is_followed_after_stretching_ends() -> None:
    follow = Follow(CIRCLE, 300.0, 4.0, 0.25)
    session = Session(StretchyTubes(CIRCLE, 150.0, 200.0, until=1.0, then=follow))
    session.at([0.05, 0.0, 0.0])
    session.drag([0.05, 0.0, 0.0], [0.065, 0.0, 0.01])
    session.time = 2.0
    performed = Follow(session.curve, 300.0, 4.0, 0.25)
    for phase in np.linspace(0.0, 4.0, 23):
        p, v = session.curve.point(phase) + np.array([0.004, 0.0, 0.003]), [0.1, 0.0, -0.1]
        expected = performed.wrench(HandState.at(p, v)).force
        # The switch has no effect any more.
        np.testing.assert_allclose(session.at(p, phase > 2.0, v=v), expected, atol=1e-9)
    assert session.edits == 1


def test_force_eases_continuously_from_seeking_into_follow() -> None:
    session = Session(StretchyTubes(CIRCLE, 150.0, 200.0, 2.0, until=1.0, then=Follow(CIRCLE, 300.0, 4.0), ease=0.8))
    p, v = CIRCLE.point(1.0) + np.array([0.0, 0.0, 0.003]), np.array([0.01, -0.02, 0.0])
    full, forces = Follow(CIRCLE, 300.0, 4.0).wrench(HandState.at(p, v)).force, [session.at(p, v=v)]
    for share in np.linspace(0.0, 1.2, 121):
        session.time = 1.0 + 0.8 * share
        forces.append(session.at(p, v=v, after=0.0))
    eased = np.array(forces)
    # First the force of before, at half time the mean of both, at last that of FOLLOW.
    np.testing.assert_allclose(eased[1], eased[0], atol=1e-12)
    np.testing.assert_allclose(eased[51], 0.5 * (eased[0] + full), atol=1e-9)
    np.testing.assert_allclose(eased[101:], np.tile(full, (21, 1)), atol=1e-12)
    # It grows fastest in the middle, by 15/8 of the mean.
    steps = np.linalg.norm(np.diff(eased[1:], axis=0), axis=1) / np.linalg.norm(full - eased[0])
    assert steps.max() < 0.01 * 15.0 / 8.0 + 1e-6


def test_edit_in_progress_is_committed_when_stretching_ends() -> None:
    session = Session(StretchyTubes(CIRCLE, 150.0, 200.0, until=1.0, then=Follow(CIRCLE, 300.0, 4.0)))
    session.at([0.05, 0.0, 0.0], True)
    session.at([0.07, 0.0, 0.0], True)
    session.at([0.07, 0.0, 0.0], True, after=2.0)
    assert session.edits == 1
    np.testing.assert_allclose(session.curve.point(0.0), [0.07, 0.0, 0.0], atol=1e-9)


def test_each_of_two_tubes_bends_its_own_curve() -> None:
    upper = StretchyTubes(Trajectory.circle(0.05, 4.0, (0.0, 0.0, 0.05)), 50.0, 200.0, 0.0)
    program = TUBES.program() + upper.program()
    session = Session(TUBES, program)
    slots = [place.memory for place in program.places()]
    session.at([0.05, 0.0, 0.05])
    session.drag([0.05, 0.0, 0.05], [0.065, 0.0, 0.05])
    assert [len(field.edits(session.memory, slot)) for field, slot in zip((TUBES, upper), slots, strict=True)] == [0, 1]
    np.testing.assert_allclose(upper.edited(session.memory, slots[1]).point(0.0), [0.065, 0.0, 0.05], atol=1e-9)


def test_non_finite_hand_gives_nan_force_and_leaves_the_curve() -> None:
    session = Session(TUBES)
    session.at([0.05, 0.0, 0.0])
    session.at([0.05, 0.0, 0.0], True)
    before = session.memory.copy()
    assert np.isnan(session.at([np.nan, 0.0, 0.0], True)).all()
    np.testing.assert_array_equal(session.memory[TRACE_SIZE:], before[TRACE_SIZE:])


@pytest.mark.parametrize("p", [[0.0, 0.0, 0.0], [1e6, 0.0, 0.0], [0.0, 0.0, 0.03], [0.05, 0.0, 0.0]])
@pytest.mark.parametrize("switch", [False, True])
def test_force_is_finite_everywhere(p: list[float], switch: bool) -> None:
    session = Session(TUBES)
    for _ in range(3):
        assert np.isfinite(session.at(p, switch)).all()
    # For a probe that jumps onto the curve itself there is no side to push to.
    session.at([0.2, 0.0, 0.0])
    session.at([0.2, 0.0, 0.0], True)
    assert np.isfinite(session.at([0.05, 0.0, 0.0], True)).all()


def test_wrench_equals_the_compiled_program() -> None:
    rng = np.random.default_rng(2)
    for _ in range(10):
        hand = HandState.at(rng.normal(size=3) * 0.05, rng.normal(size=3) * 0.1, 0.3)
        wrench = np.empty(6)
        program = TUBES.program()
        evaluate(*program.compiled(), program.fresh_memory(), hand.vector(), wrench)
        np.testing.assert_array_equal(TUBES.wrench(hand).force, wrench[:3])


def test_stretch_force_matches_casadi() -> None:
    symbols = [casadi.SX.sym(name) for name in ("p", "v", "target", "k", "b")]
    symbolic = casadi.Function("F", symbols, [stretch_force.py_func(*symbols)])
    numbers = (0.04, -0.2, 0.05, 150.0, 3.0)
    assert float(symbolic(*numbers)) == pytest.approx(stretch_force(*numbers), rel=1e-15)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"k_f": -1.0, "k_s": 1.0}, ParameterError, "k_f must be finite and at least 0 N/m, got -1.0"),
        ({"k_f": 1.0, "k_s": np.nan}, ParameterError, "k_s"),
        ({"k_f": 1.0, "k_s": 1.0, "epsilon": np.inf}, ParameterError, "epsilon"),
        ({"k_f": 1.0, "k_s": 1.0, "until": 3.0}, ParameterError, "stretching ends after 3.0 s"),
        ({"k_f": 1.0, "k_s": 1.0, "width": 9.0}, CurveError, "got 9.0"),
    ],
)
def test_invalid_arguments_raise(arguments, error, message) -> None:
    with pytest.raises(error, match=message):
        StretchyTubes(CIRCLE, **arguments).program()
