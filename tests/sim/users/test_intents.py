"""Submovements, natural pace, and the tables of wishes that intents make."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from sim.errors import SimError
from sim.users.hand.actions import Grab, Push
from sim.users.intents import Bend, ChangeOver, CutCorner, Exaggerate, GetLost, Lead, Own, Press, Relax, Resist, Trace
from sim.users.participant import Participant
from sim.users.person.submovement import aimed_seconds, set_submovement, submovement
from sim.users.person.wishes import ENGAGED, FORCE, GRIP, PLACE, SWITCH, Wishes, following, targets, wanted_motion

CIRCLE = Trajectory.circle(0.04, 4.0)
INTENTS = [
    Relax(), Trace(), Exaggerate(), CutCorner(), ChangeOver(), Resist(), GetLost(), Press([Push(1.0, 1.0, 2.0)]),
    Bend([Grab(0.5, (0.01, 0.0, 0.0), place=(0.04, 0.0, 0.0))]),
]  # fmt: skip


def test_submovement_meets_both_ends_with_least_jerk() -> None:
    rng = np.random.default_rng(1)
    start, goal, plan, seconds = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), np.zeros((6, 3)), 0.37
    set_submovement(plan, start, goal, seconds)
    state = np.zeros((3, 3))
    for elapsed, end in ((0.0, start), (seconds, goal)):
        submovement(plan, seconds, elapsed, state)
        np.testing.assert_allclose(state[:2], end[:2], atol=1e-10)
    submovement(plan, seconds, seconds * (1.0 - 1e-9), state)
    np.testing.assert_allclose(state[2], goal[2], atol=1e-5)
    # A minimum of ∫ x⃛² has no sixth derivative: any variation that keeps both ends has more jerk.
    s = np.linspace(0.0, 1.0, 4001)
    jerk = (6.0 * plan[3, 0] + 24.0 * plan[4, 0] * s + 60.0 * plan[5, 0] * s**2) / seconds**3
    change = np.polynomial.Polynomial([0, 0, 0, 1, -3, 3, -1]).deriv(3)(s) / seconds**3  # s³ (1 − s)³
    assert abs(np.trapezoid(jerk * change, s)) < 1e-5 * np.sqrt(np.trapezoid(jerk**2, s) * np.trapezoid(change**2, s))


def test_submovement_count_minimises_the_total_time() -> None:
    def total(n: int, x: float, scatter: float) -> float:
        return n * (0.2 + max(0.16, scatter * x ** (1.0 / n)))

    for x, scatter in ((2.0, 0.01), (30.0, 0.02), (300.0, 0.02), (300.0, 0.08)):
        best = min(range(1, 9), key=lambda n: total(n, x, scatter))
        assert aimed_seconds(x, scatter, 0.2, 0.16) == pytest.approx(total(best, x, scatter) / best - 0.2)


def test_wanted_motion_interpolates_its_rows_and_rests_at_its_end() -> None:
    t = np.arange(0.0, 1.0, 0.02)
    rows, motion = following(np.stack([np.sin(3.0 * t), t, 0.0 * t], axis=1)), np.zeros((3, 3))
    wanted_motion(rows, 0.02, 0.413, motion)
    np.testing.assert_allclose(motion[0], [np.sin(1.239), 0.413, 0.0], atol=1e-5)
    np.testing.assert_allclose(motion[1], [3.0 * np.cos(1.239), 1.0, 0.0], atol=2e-3)
    wanted_motion(rows, 0.02, 9.0, motion)
    np.testing.assert_array_equal(motion[0], rows[-1, :3])
    np.testing.assert_array_equal(motion[1:], 0.0)


@pytest.mark.parametrize("intent", INTENTS, ids=lambda intent: type(intent).__name__)
def test_every_intent_covers_its_run_and_is_reproducible(intent) -> None:
    wishes = intent.wishes(CIRCLE, 8.0, 3)
    assert len(wishes.rows) * wishes.period >= 8.0
    np.testing.assert_array_equal(wishes.rows, intent.wishes(CIRCLE, 8.0, 3).rows)


def row_at(wishes: Wishes, t: float) -> np.ndarray:
    return wishes.rows[round(t / wishes.period)]


def test_exaggerate_goes_outwards_then_inwards() -> None:
    wishes = Exaggerate(larger=1.5, calmer=0.5).wishes(CIRCLE, 8.0, 1)
    assert np.hypot(*row_at(wishes, 1.0)[:2]) == pytest.approx(0.06, rel=1e-3)
    assert np.hypot(*row_at(wishes, 3.0)[:2]) == pytest.approx(0.02, rel=1e-3)
    assert np.hypot(*row_at(wishes, 4.0)[:2]) == pytest.approx(0.04, rel=1e-3)


def test_cut_corner_is_straight() -> None:
    wishes = CutCorner(0.25, 0.5).wishes(CIRCLE, 4.0, 1)
    first, middle, last = (row_at(wishes, t)[:3] for t in (1.02, 1.5, 1.98))
    np.testing.assert_allclose(middle, 0.5 * (first + last), atol=1e-9)
    assert np.hypot(*middle[:2]) < 0.04 * np.cos(np.pi / 4.0) + 1e-4


def test_change_over_ends_on_the_other_curve() -> None:
    wishes = ChangeOver(Trajectory.circle(0.06, 4.0), at=3.0).wishes(CIRCLE, 8.0, 1)
    assert np.hypot(*row_at(wishes, 2.5)[:2]) == pytest.approx(0.04, rel=1e-3)
    assert np.hypot(*row_at(wishes, 6.0)[:2]) == pytest.approx(0.06, rel=1e-3)


def test_resist_holds_its_place_with_a_firm_grip_then_continues() -> None:
    wishes = Resist(at=1.0, seconds=2.0, grip=9.0).wishes(CIRCLE, 8.0, 1)
    np.testing.assert_allclose(row_at(wishes, 1.2)[:3], row_at(wishes, 2.8)[:3])
    assert row_at(wishes, 2.0)[GRIP] == 9.0
    np.testing.assert_allclose(row_at(wishes, 3.2)[:3], CIRCLE.point(CIRCLE.start + 1.2), atol=1e-9)


def test_get_lost_leaves_the_curve_lets_go_and_comes_back() -> None:
    wishes = GetLost(at=1.0, seconds=4.0).wishes(CIRCLE, 8.0, 5)
    away = np.linalg.norm(wishes.rows[:, :3] - CIRCLE.point(CIRCLE.start + 0.02 * np.arange(len(wishes.rows))), axis=1)
    assert away.max() > 0.005
    assert away[:50].max() < 1e-9
    assert away[260:].max() < 1e-9
    assert row_at(wishes, 3.0)[ENGAGED] == 0.0
    assert row_at(wishes, 6.0)[ENGAGED] == 1.0


def test_bend_presses_the_switch_while_it_carries() -> None:
    grab = Grab(1.0, (0.02, 0.0, 0.0), seconds=1.0, hold=0.5, place=(0.04, 0.0, 0.0), reach=0.8)
    wishes = Bend([grab]).wishes(CIRCLE, 6.0, 1)
    assert [row_at(wishes, t)[SWITCH] for t in (0.5, 1.5, 2.0, 3.2, 4.0)] == [0.0, 0.0, 1.0, 1.0, 0.0]
    np.testing.assert_allclose(row_at(wishes, 3.1)[PLACE : PLACE + 3], [0.06, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("pause", [0.0, 0.1, 2.0])
def test_place_of_one_who_bends_moves_smoothly_from_grab_to_grab(pause: float) -> None:
    """A person plans 0.3 s ahead of her clock: a place that jumps as she lets go throws the stylus away."""
    first = Grab(1.0, (0.02, 0.0, 0.0), seconds=1.0, hold=0.5, place=(0.04, 0.0, 0.0), reach=0.8)
    second = Grab(first.end + pause, (0.0, 0.01, 0.0), seconds=1.0, hold=0.5, place=(-0.04, 0.0, 0.0), reach=0.8)
    wishes = Bend([second, first]).wishes(CIRCLE, 12.0, 1)
    places, step = wishes.rows[:, PLACE : PLACE + 3], wishes.period
    assert np.linalg.norm(np.diff(places, 2, axis=0), axis=1).max() / step**2 < 1.0  # [m/s^2]
    expected = {0.0: first.place, first.end: (0.06, 0.0, 0.0), second.at + 0.8: second.place, 11.9: (-0.04, 0.01, 0.0)}
    for t, place in expected.items():
        np.testing.assert_allclose(row_at(wishes, t)[PLACE : PLACE + 3], place, atol=2e-4)


def test_press_is_a_force_away_from_the_middle() -> None:
    wishes = Press([Push(1.0, 1.0, 2.0)]).wishes(CIRCLE, 4.0, 1)
    outward = CIRCLE.point(CIRCLE.start + 1.5) / 0.04
    np.testing.assert_allclose(row_at(wishes, 1.5)[FORCE : FORCE + 3], 2.0 * outward, atol=1e-3)


@pytest.mark.parametrize(
    "make_intent",
    [
        lambda: Exaggerate(larger=9.0), lambda: CutCorner(0.6, 0.5), lambda: Resist(grip=99.0), lambda: Trace(0.0),
        lambda: GetLost(away=1.0), lambda: ChangeOver(seconds=0.0), lambda: Own(print, every=0.0),
        lambda: Press([Push(0.0, 1.0, 1.0, place=(0.0, 0.0, 0.0))]), lambda: Bend([Grab(0.0, (0.0, 0.0, 0.0))]),
        lambda: Wishes(np.zeros((3, 4))), lambda: Wishes(np.full((3, 10), np.nan)),
        lambda: targets(np.zeros((2, 3)), 0.0),
        lambda: Press([]), lambda: Bend([]), lambda: ChangeOver(at=np.inf), lambda: Resist(at=np.inf),
        lambda: GetLost(at=np.inf), lambda: GetLost(seconds=np.inf), lambda: GetLost(seconds=np.nan),
        lambda: Lead([], 0.1), lambda: Lead(np.zeros((3, 2)), 0.1), lambda: Lead(np.full((3, 3), np.nan), 0.1),
        lambda: Lead(np.zeros((3, 3)), 0.0), lambda: Lead(np.zeros((3, 3)), -1.0),
        lambda: Lead(np.zeros((3, 3)), np.nan),
    ],
)  # fmt: skip
def test_invalid_intent_is_refused(make_intent) -> None:
    with pytest.raises(SimError, match=r"expected|needs"):
        make_intent()


def test_intent_with_wrong_values_or_arguments_is_refused_by_name() -> None:
    for make_intent, message in (
        (lambda: Lead("x", 0.1), "points is 'x'; expected numbers"),  # pyright: ignore
        (lambda: Lead(np.zeros((3, 3)), "x"), "period is 'x'; expected a number"),  # pyright: ignore
        (lambda: Own(lambda t: t), "function is <lambda>(t); expected a function of t, place, force"),
        (
            lambda: Own(lambda t, p, f: p, compiled=True),
            "<lambda>(t, p, f); expected a function of t, place, force, rows",
        ),
        (lambda: Own(3), "function is 3; expected a function of t, place, force"),  # pyright: ignore
    ):
        with pytest.raises(ParameterError) as error:
            make_intent()
        assert message in str(error.value)
    rows = Lead([(0, 0, 0), (0, 0, 0.1)], 1.0).wishes(CIRCLE, 4.0, 1).rows  # pyright: ignore
    assert rows[-1, PLACE + 2] == 0.1


def test_error_of_an_own_intent_names_its_cause() -> None:
    def nothing(t, place, force):
        return "up"

    person = Participant(wishes=Own(nothing).wishes(CIRCLE, 1.0, 1), own=Own(nothing)).holding(1e-3, 1e-4)
    with pytest.raises(SimError, match="expected a position"):
        Own(nothing).ask(person, 0.0)
    with pytest.raises(SimError, match="cannot be compiled"):
        Own(lambda t, place, force, rows: unknown(t), compiled=True).address()  # noqa: F821 # pyright: ignore
