"""LEADING: what the hand feels, how the figure follows, that it turns only as support allows, and that it goes back."""

import casadi
import numpy as np
import pytest
from field_probes import force_of, largest_jump
from numba import njit

from controllers.errors import ParameterError
from controllers.fields.instructions import TRACE_SIZE
from controllers.fields.leading import Gait, Leading, leading_force
from controllers.fields.program import evaluate
from controllers.state import HandState
from controllers.walking.walked_path import (
    PATH_HEADING,
    PATH_X,
    PATH_Y,
    ROWS,
    STEP,
    path_back,
    path_front,
    path_value,
)
from controllers.walking.walker import walker_at

# A run: one foot, none, the other, none; and a walk on one or two.
_RUN = Gait(2.2, 3.0, np.repeat([1, 0, 1, 0], [32, 12, 32, 12]), 0.6)
_WALK = Gait(1.4, 1.25, np.repeat([2, 1, 2, 1], [18, 48, 18, 48]), 0.45)
FIELD = Leading(_WALK, (-0.06, 0.0), heading=0.3, scale=40.0)
LEAD = 2.0 * _WALK.speed / FIELD.rate
RATE = 1e-3


@njit
def lead_along(units, ops, params, memory, hands, period, walker):
    """A hand that is where it wants to be; s, speed and force after each tick."""
    hand, wrench = np.zeros(15), np.zeros(6)
    hand[4] = 1.0
    for k in range(len(hands)):
        hand[0], hand[1:4] = hand[0] + period, hands[k]
        evaluate(units, ops, params, memory, hand, wrench)
        state = walker_at(memory, TRACE_SIZE)
        walker[k, 0], walker[k, 1] = state.argument[0], state.speed[0]
        walker[k, 2:] = wrench[:3]


def led(field, hands, memory=None):
    program, walker = field.program(), np.empty((len(hands), 5))
    memory = program.fresh_memory() if memory is None else memory
    lead_along(*program.compiled(), memory, np.ascontiguousarray(hands), RATE, walker)
    return walker, memory


def frames(memory, places):
    path = FIELD.walker(memory).path
    return np.array([[path_value(path, s, k)[0] for k in (PATH_X, PATH_Y, PATH_HEADING)] for s in places])


def turn_rates(walker, memory):
    slopes = np.array([path_value(FIELD.walker(memory).path, s, PATH_HEADING)[1] for s in walker[:, 0]])
    return np.abs(slopes * walker[:, 1])


def feet(gait, s):
    lap = s / gait.stride
    return gait.support[(len(gait.support) * (lap - np.floor(lap))).astype(int)]


def s_shaped(field, seconds=5.0, pace=1.0):
    """Places of a hand that leads along an S: at rest, along, at rest, each tick."""
    t = np.arange(0.0, seconds, RATE)
    ramp = np.clip(t / 0.5, 0.0, 1.0) * np.clip((seconds - t) / 0.5, 0.0, 1.0)
    angle = field.heading + 0.7 * np.sin(2.0 * np.pi * t / seconds)
    steps = RATE * pace * field.gait.speed / field.scale * ramp[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    places = np.array(field.start) + np.cumsum(steps, axis=0)
    return np.column_stack([places, np.zeros(len(t))])


def rest(place, seconds=2.0):
    return np.tile(place, (round(seconds / RATE), 1))


def straight(start, end, seconds):
    return start + np.linspace(0.0, 1.0, round(seconds / RATE))[:, None] * (end - start)


def wild(field, seed, seconds=8.0):
    """A hand that dashes about, smoothly, within 16 cm, forward more often than not."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, RATE)
    waves = sum(
        rng.normal(size=2) * 0.05 / k * np.sin(2 * np.pi * 0.2 * k * t[:, None] + rng.uniform(0, 6, 2)) for k in (1, 2)
    )
    way = np.outer(0.02 * t, [np.cos(field.heading), np.sin(field.heading)])
    places = np.array(field.start) + way + waves - waves[0]
    return np.column_stack([places, np.zeros(len(t))])


def at(along, across, height=0.0, field=FIELD):
    """Hand at a place ahead of and beside where the figure wants it, in metres on the floor."""
    c, s = np.cos(field.heading), np.sin(field.heading)
    x, y = (along * c - across * s) / field.scale, (along * s + across * c) / field.scale
    return HandState.at([field.start[0] + x, field.start[1] + y, height])


@pytest.mark.parametrize(
    ("along", "across", "excess_t", "excess_n"),
    [
        (0.0, 0.0, 0.0, 0.0),
        (0.9 * LEAD, 0.0, 0.0, 0.0),
        (LEAD + 0.3, 0.0, 0.3, 0.0),
        # One metre on, an arc of curvature 1/m leads half a metre aside: no farther.
        (0.8, 0.5 * (0.8 + STEP) ** 2 - 0.03, 0.0, 0.0),
        (0.8, 0.7, 0.0, 0.7 - 0.5 * 0.8**2),
        (-0.3, 0.2, 0.0, 0.2),
        (-FIELD.backward * LEAD - 0.25, 0.0, -0.25, 0.0),
    ],
)
def test_the_hand_feels_what_of_its_lead_cannot_be_followed(along, across, excess_t, excess_n):
    force = FIELD.wrench(at(along, across)).force
    c, s = np.cos(FIELD.heading), np.sin(FIELD.heading)
    felt = np.array([c * force[0] + s * force[1], c * force[1] - s * force[0]])
    expected = -FIELD.k_l / FIELD.scale * np.array([excess_t, excess_n])
    # The path is laid up to one of its steps farther than D.
    tolerance = FIELD.k_l / FIELD.scale * STEP * (1.0 if along > 0.0 and across else 1e-6)
    np.testing.assert_allclose(felt, expected, atol=tolerance)


def test_the_hand_is_kept_in_its_plane_and_damped():
    force = FIELD.wrench(at(0.0, 0.0, 0.01)).force
    assert force[2] == pytest.approx(-0.01 * FIELD.k_z)
    hand = HandState.at([*FIELD.start, 0.0], [0.1, -0.2, 0.3])
    np.testing.assert_allclose(FIELD.wrench(hand).force, -FIELD.b * hand.v, atol=1e-12)


def test_the_force_has_no_jump_along_random_lines():
    rng, program = np.random.default_rng(3), FIELD.program()
    for _ in range(4):
        ends = np.append(FIELD.start, 0.0) + rng.uniform(-0.06, 0.06, (2, 3))
        assert largest_jump(program, *ends, samples=150, hunts=3) < 1e-9


@pytest.mark.parametrize("place", [[1e3, -1e3, 1e3], [-1e6, 0.0, 0.0], [0.0, 1e9, 0.0]])
def test_the_force_is_finite_however_far_the_hand_is(place):
    assert np.isfinite(force_of(FIELD.program(), HandState.at(place))).all()


def test_what_is_not_finite_reaches_the_limiter_and_not_the_path():
    hands = s_shaped(FIELD)
    _, memory = led(FIELD, hands[:2000])
    kept = memory[TRACE_SIZE:].copy()
    bad, _ = led(FIELD, np.full((3, 3), np.nan), memory)
    assert np.isnan(bad[:, 2:]).all()
    np.testing.assert_array_equal(memory[TRACE_SIZE:], kept)


def test_python_and_the_compiled_program_feel_the_same_to_the_last_bit():
    rng = np.random.default_rng(8)
    for _ in range(20):
        hand = HandState.at(rng.normal(size=3) * 0.05, rng.normal(size=3) * 0.1)
        np.testing.assert_array_equal(FIELD.wrench(hand).force, force_of(FIELD.program(), hand))


def test_the_compiled_law_is_the_symbolic_one():
    mode = casadi.GlobalOptions.getNumpyMode()
    casadi.GlobalOptions.setNumpyMode(1)
    symbols = [casadi.SX.sym(f"x{i}") for i in range(15)]
    law, rng = casadi.Function("law", symbols, list(leading_force.py_func(*symbols))), np.random.default_rng(5)
    casadi.GlobalOptions.setNumpyMode(mode)
    for _ in range(30):
        numbers = rng.uniform(0.1, 1.0, 15)
        np.testing.assert_allclose(leading_force(*numbers), np.ravel(law(*numbers)), rtol=1e-13)


@pytest.mark.parametrize("gait", [_WALK, _RUN], ids=["walk", "run"])
@pytest.mark.parametrize("seed", range(3))
def test_turning_and_inertia_are_bounded_whatever_the_hand_does(gait, seed):
    field = Leading(gait, (-0.06, 0.0), scale=32.0 * gait.speed)
    walker, memory = led(field, wild(field, seed))
    rates, support = turn_rates(walker, memory), feet(gait, walker[:, 0])
    bounds = np.array([0.0, field.turn_one, field.turn_two])[support]
    assert np.all(rates <= bounds + 1e-9)
    assert np.all(rates[support == 0] == 0.0)
    assert np.all(rates * np.abs(walker[:, 1]) <= field.lateral + 1e-9)
    assert np.abs(np.diff(walker[:, 1])).max() <= 1.02 * RATE * field.pull
    assert walker[:, 1].max() <= field.forward * gait.speed + 1e-12
    # The bounds bind: without them the figure would turn and accelerate more.
    assert rates.max() > 0.5 * field.turn_one
    assert np.abs(np.diff(walker[:, 1])).max() > 0.9 * RATE * field.pull


def test_a_figure_on_two_feet_turns_more_than_on_one():
    walker, memory = led(FIELD, wild(FIELD, 1))
    rates, support = turn_rates(walker, memory), feet(_WALK, walker[:, 0])
    assert rates[support == 2].max() > 1.1 * rates[support == 1].max()


@pytest.mark.parametrize("gait", [_WALK, _RUN], ids=["walk", "run"])
def test_led_along_an_s_and_straight_back_it_retraces_its_path(gait):
    field = Leading(gait, (-0.06, 0.0), scale=32.0 * gait.speed)
    forth = np.vstack([s_shaped(field), rest(s_shaped(field)[-1], 5.0)])
    back = np.vstack([straight(forth[-1], forth[0], 8.0), rest(forth[0], 4.0)])
    walker, memory = led(field, forth)
    way = frames(memory, walker[:, 0])
    returning, memory = led(field, back, memory)
    again = frames(memory, returning[:, 0])
    assert walker[-1, 0] > 3.0 * gait.speed
    assert returning[-1, 0] < 0.05 * walker[-1, 0]
    for place in again[(returning[:, 0] >= 0.0) & (returning[:, 0] <= walker[-1, 0])][::50]:
        k = int(np.argmin(np.hypot(*(way[:, :2] - place[:2]).T)))
        assert np.hypot(*(way[k, :2] - place[:2])) < 0.01
        assert abs(way[k, 2] - place[2]) < np.radians(2.0)
    # The hand comes straight, the figure by the S: the force guided it there, and more than a little.
    assert np.linalg.norm(returning[:, 2:4], axis=1).max() > 0.2


def test_forward_again_it_enters_its_path_and_goes_on_beyond_its_end():
    forth = np.vstack([s_shaped(FIELD), rest(s_shaped(FIELD)[-1])])
    walker, memory = led(FIELD, forth)
    front = path_front(FIELD.walker(memory).path)
    places = np.linspace(0.0, front, 300)
    before = frames(memory, places)
    half = forth[len(forth) // 3]
    _, memory = led(FIELD, np.vstack([straight(forth[-1], half, 5.0), rest(half)]), memory)
    middle = float(FIELD.walker(memory).argument[0])
    assert 0.2 * walker[-1, 0] < middle < 0.6 * walker[-1, 0]
    assert path_front(FIELD.walker(memory).path) == front
    ahead = forth[-1] + 0.04 * np.array([np.cos(before[-1, 2]), np.sin(before[-1, 2]), 0.0])
    way = np.vstack([straight(half, forth[-1], 5.0), straight(forth[-1], ahead, 2.0), rest(ahead)])
    _, memory = led(FIELD, way, memory)
    np.testing.assert_array_equal(frames(memory, places), before)
    assert FIELD.walker(memory).argument[0] > walker[-1, 0] + 1.0


def test_an_endless_walk_needs_no_more_memory_and_can_go_back_as_far_as_it_remembers():
    t = np.arange(0.0, 75.0, RATE)
    radius = 2.2 / FIELD.scale
    angle = np.clip(t - 0.5, 0.0, None) * 0.55
    c, s = np.cos(FIELD.heading), np.sin(FIELD.heading)
    x, y = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
    circle = np.column_stack([FIELD.start[0] + c * x - s * y, FIELD.start[1] + s * x + c * y, 0.0 * t])
    walker, memory = led(FIELD, circle)
    assert walker[-1, 0] > ROWS * STEP
    assert np.isfinite(walker).all()
    assert len(memory) == len(FIELD.program().memory)
    radii = np.hypot(*(frames(memory, walker[-4000:, 0])[:, :2] / FIELD.scale - circle[:, :2].mean(axis=0)).T)
    assert np.ptp(radii) < 0.15 * radius
    oldest = path_back(FIELD.walker(memory).path)
    assert oldest > 5.0
    returning, memory = led(FIELD, circle[::-1], memory)
    assert returning[-1, 0] >= oldest
    assert returning[-1, 0] < oldest + 3.0


def test_the_same_tick_again_moves_nothing():
    _, memory = led(FIELD, s_shaped(FIELD)[:1500])
    program, wrenches = FIELD.program(), np.empty((2, 6))
    hand = HandState.at([0.0, 0.0, 0.0], t=2.0).vector()
    evaluate(*program.compiled(), memory, hand, wrenches[0])
    kept = memory.copy()
    evaluate(*program.compiled(), memory, hand, wrenches[1])
    assert FIELD.walker(memory).argument[0] == FIELD.walker(kept).argument[0]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Leading(_WALK, k_l=-1.0), "k_l must be finite and at least 0 N/m, got -1.0"),
        (lambda: Leading(_WALK, scale=0.0), "scale"),
        (lambda: Leading(_WALK, heading=np.nan), "heading must be finite"),
        (lambda: Leading(_WALK, turn_one=2.0), "no faster on one foot than on two"),
        (lambda: Gait(1.0, np.inf, np.array([1, 2]), 0.3), "speed"),
        (lambda: Gait(1.0, 1.0, np.array([1, 3]), 0.3), "0, 1 or 2 feet"),
    ],
)
def test_bad_numbers_are_refused(make, says):
    with pytest.raises(ParameterError, match=says):
        make()
