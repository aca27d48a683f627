"""LEADING: the force on the hand, the figure's path and its bounds by support, and walking back along it."""

import casadi
import numpy as np
import pytest
from numba import njit

from controllers.errors import ParameterError
from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import feed_walkers
from controllers.fields.leading import Leading, LeadingGains, PathPoint, leading_force
from controllers.state import HandState
from controllers.walking.gait import Gait
from controllers.walking.walked_path import PATH_HEADING, PATH_X, PATH_Y, ROWS, STEP, path_back, path_front, path_value
from controllers.walking.walker import walker_at
from controllers.walking.walking import Walking
from tests.controllers.fields.field_probes import force_of, largest_jump

# A run: one foot, none, the other, none; and a walk on one or two.
_RUN = Gait(2.2, 3.0, np.repeat([1, 0, 1, 0], [32, 12, 32, 12]), 0.6)
_WALK = Gait(1.4, 1.25, np.repeat([2, 1, 2, 1], [18, 48, 18, 48]), 0.45)
WALKING = Walking(_WALK, (-0.06, 0.0), heading=0.3, scale=40.0)
FIELD = Leading(WALKING)
LEAD = WALKING.lead[0]
RATE = 1e-3


@njit
def lead_along(units, ops, params, memory, walkers, hands, period, trail):
    """Argument s, speed and force (n, 5) after each tick, for a hand that follows given positions."""
    hand, wrench = np.zeros(15), np.zeros(6)
    hand[4] = 1.0
    for k in range(len(hands)):
        hand[0], hand[1:4] = hand[0] + period, hands[k]
        feed_walkers(walkers, params, memory, hand)
        evaluate(units, ops, params, memory, hand, wrench)
        state = walker_at(walkers.state, 0)
        trail[k, 0], trail[k, 1] = state.argument[0], state.speed[0]
        trail[k, 2:] = wrench[:3]


def led(field, hands, walkers=None):
    program, trail = field.program(), np.empty((len(hands), 5))
    walkers = program.fresh_walkers() if walkers is None else walkers
    memory = program.fresh_memory()
    lead_along(*program.compiled(), memory, walkers, np.ascontiguousarray(hands), RATE, trail)
    return trail, walkers


def walker_of(walkers):
    return walker_at.py_func(walkers.state, 0)


def frames(walkers, arguments):
    path = walker_of(walkers).path
    return np.array([[path_value(path, s, k)[0] for k in (PATH_X, PATH_Y, PATH_HEADING)] for s in arguments])


def turn_rates(trail, walkers):
    slopes = np.array([path_value(walker_of(walkers).path, s, PATH_HEADING)[1] for s in trail[:, 0]])
    return np.abs(slopes * trail[:, 1])


def support_at(gait, s):
    lap = s / gait.stride
    return gait.support[(len(gait.support) * (lap - np.floor(lap))).astype(int)]


def s_shaped(walking, seconds=5.0, pace=1.0):
    """Positions at each tick of a hand that leads along an S, from rest to rest."""
    t = np.arange(0.0, seconds, RATE)
    ramp = np.clip(t / 0.5, 0.0, 1.0) * np.clip((seconds - t) / 0.5, 0.0, 1.0)
    angle = walking.heading + 0.7 * np.sin(2.0 * np.pi * t / seconds)
    steps = (
        RATE * pace * walking.gait.speed / walking.scale * ramp[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    )
    positions = np.array(walking.start) + np.cumsum(steps, axis=0)
    return np.column_stack([positions, np.zeros(len(t))])


def resting(position, seconds=2.0):
    return np.tile(position, (round(seconds / RATE), 1))


def straight(start, end, seconds):
    return start + np.linspace(0.0, 1.0, round(seconds / RATE))[:, None] * (end - start)


def erratic(walking, seed, seconds=8.0):
    """Positions of a hand that moves fast and smoothly within 16 cm, on average forward."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, RATE)
    waves = sum(
        rng.normal(size=2) * 0.05 / k * np.sin(2 * np.pi * 0.2 * k * t[:, None] + rng.uniform(0, 6, 2)) for k in (1, 2)
    )
    advance = np.outer(0.02 * t, [np.cos(walking.heading), np.sin(walking.heading)])
    positions = np.array(walking.start) + advance + waves - waves[0]
    return np.column_stack([positions, np.zeros(len(t))])


def hand_at(along, across, height=0.0, walking=WALKING):
    """Hand ahead of and beside the position that corresponds to the figure, in metres on the floor."""
    c, s = np.cos(walking.heading), np.sin(walking.heading)
    x, y = (along * c - across * s) / walking.scale, (along * s + across * c) / walking.scale
    return HandState.at([walking.start[0] + x, walking.start[1] + y, height])


@pytest.mark.parametrize(
    ("along", "across", "excess_t", "excess_n"),
    [
        (0.0, 0.0, 0.0, 0.0),
        (0.9 * LEAD, 0.0, 0.0, 0.0),
        (LEAD + 0.3, 0.0, 0.3, 0.0),
        # After one metre the tightest arc, of curvature 1/m, is half a metre aside.
        (0.8, 0.5 * (0.8 + STEP) ** 2 - 0.03, 0.0, 0.0),
        (0.8, 0.7, 0.0, 0.7 - 0.5 * 0.8**2),
        (-0.3, 0.2, 0.0, 0.2),
        (-WALKING.backward * LEAD - 0.25, 0.0, -0.25, 0.0),
    ],
)
def test_force_is_the_excess_of_the_lead_that_the_figure_cannot_follow(along, across, excess_t, excess_n):
    force = FIELD.wrench(hand_at(along, across)).force
    c, s = np.cos(WALKING.heading), np.sin(WALKING.heading)
    felt = np.array([c * force[0] + s * force[1], c * force[1] - s * force[0]])
    expected = -FIELD.k_l / WALKING.scale * np.array([excess_t, excess_n])
    # The path extends up to one of its steps beyond D.
    tolerance = FIELD.k_l / WALKING.scale * STEP * (1.0 if along > 0.0 and across else 1e-6)
    np.testing.assert_allclose(felt, expected, atol=tolerance)


def test_force_holds_the_hand_in_its_plane_and_damps():
    force = FIELD.wrench(hand_at(0.0, 0.0, 0.01)).force
    assert force[2] == pytest.approx(-0.01 * FIELD.k_z)
    hand = HandState.at([*WALKING.start, 0.0], [0.1, -0.2, 0.3])
    np.testing.assert_allclose(FIELD.wrench(hand).force, -FIELD.b * hand.v, atol=1e-12)


def test_force_is_continuous_along_random_lines():
    rng, program = np.random.default_rng(3), FIELD.program()
    for _ in range(4):
        ends = np.append(WALKING.start, 0.0) + rng.uniform(-0.06, 0.06, (2, 3))
        assert largest_jump(program, *ends, samples=150, hunts=3) < 1e-9


@pytest.mark.parametrize("position", [[1e3, -1e3, 1e3], [-1e6, 0.0, 0.0], [0.0, 1e9, 0.0]])
def test_force_is_finite_at_any_distance(position):
    assert np.isfinite(force_of(FIELD.program(), HandState.at(position))).all()


def test_non_finite_hand_gives_nan_force_and_leaves_the_path():
    hands = s_shaped(WALKING)
    _, walkers = led(FIELD, hands[:2000])
    before = walkers.state.copy()
    trail, _ = led(FIELD, np.full((3, 3), np.nan), walkers)
    assert np.isnan(trail[:, 2:]).all()
    np.testing.assert_array_equal(walkers.state, before)


def test_wrench_equals_the_compiled_program():
    rng = np.random.default_rng(8)
    for _ in range(20):
        hand = HandState.at(rng.normal(size=3) * 0.05, rng.normal(size=3) * 0.1)
        np.testing.assert_array_equal(FIELD.wrench(hand).force, force_of(FIELD.program(), hand))


def test_compiled_law_matches_casadi():
    mode = casadi.GlobalOptions.getNumpyMode()
    casadi.GlobalOptions.setNumpyMode(1)
    sizes = (3, 3, len(PathPoint._fields), len(LeadingGains._fields))
    symbols = [casadi.SX.sym(f"x{i}", size) for i, size in enumerate(sizes)]
    force = leading_force.py_func(*symbols[:2], *(casadi.vertsplit(symbol) for symbol in symbols[2:]))
    law, rng = casadi.Function("law", symbols, list(force)), np.random.default_rng(5)
    casadi.GlobalOptions.setNumpyMode(mode)
    for _ in range(30):
        p, v, path, gains = (rng.uniform(0.1, 1.0, size) for size in sizes)
        found = leading_force(tuple(p), tuple(v), PathPoint(*path), LeadingGains(*gains))
        np.testing.assert_allclose(found, np.ravel(law(p, v, path, gains)), rtol=1e-13)


@pytest.mark.parametrize("gait", [_WALK, _RUN], ids=["walk", "run"])
@pytest.mark.parametrize("seed", range(3))
def test_turn_rate_and_acceleration_are_bounded_for_any_hand(gait, seed):
    walking = Walking(gait, (-0.06, 0.0), scale=32.0 * gait.speed)
    field = Leading(walking)
    trail, walkers = led(field, erratic(walking, seed))
    rates, support = turn_rates(trail, walkers), support_at(gait, trail[:, 0])
    bounds = np.array([0.0, walking.turn_one, walking.turn_two])[support]
    assert np.all(rates <= bounds + 1e-9)
    assert np.all(rates[support == 0] == 0.0)
    assert np.all(rates * np.abs(trail[:, 1]) <= walking.lateral + 1e-9)
    assert np.abs(np.diff(trail[:, 1])).max() <= 1.02 * RATE * walking.pull
    assert trail[:, 1].max() <= walking.forward * gait.speed + 1e-12
    # The bounds bind: without them the figure would turn and accelerate more.
    assert rates.max() > 0.5 * walking.turn_one
    assert np.abs(np.diff(trail[:, 1])).max() > 0.9 * RATE * walking.pull


def test_figure_turns_faster_on_two_feet_than_on_one():
    trail, walkers = led(FIELD, erratic(WALKING, 1))
    rates, support = turn_rates(trail, walkers), support_at(_WALK, trail[:, 0])
    assert rates[support == 2].max() > 1.1 * rates[support == 1].max()


@pytest.mark.parametrize("gait", [_WALK, _RUN], ids=["walk", "run"])
def test_hand_led_straight_back_retraces_the_path(gait):
    walking = Walking(gait, (-0.06, 0.0), scale=32.0 * gait.speed)
    field = Leading(walking)
    forth = np.vstack([s_shaped(walking), resting(s_shaped(walking)[-1], 5.0)])
    back = np.vstack([straight(forth[-1], forth[0], 8.0), resting(forth[0], 4.0)])
    trail, walkers = led(field, forth)
    outward = frames(walkers, trail[:, 0])
    returning, walkers = led(field, back, walkers)
    homeward = frames(walkers, returning[:, 0])
    assert trail[-1, 0] > 3.0 * gait.speed
    assert returning[-1, 0] < 0.05 * trail[-1, 0]
    for position in homeward[(returning[:, 0] >= 0.0) & (returning[:, 0] <= trail[-1, 0])][::50]:
        k = int(np.argmin(np.hypot(*(outward[:, :2] - position[:2]).T)))
        assert np.hypot(*(outward[k, :2] - position[:2])) < 0.01
        assert abs(outward[k, 2] - position[2]) < np.radians(2.0)
    # The hand returns straight, the figure along the S, so the force must be considerable.
    assert np.linalg.norm(returning[:, 2:4], axis=1).max() > 0.2


def test_forward_again_re_enters_the_path_and_extends_it():
    forth = np.vstack([s_shaped(WALKING), resting(s_shaped(WALKING)[-1])])
    trail, walkers = led(FIELD, forth)
    front = path_front(walker_of(walkers).path)
    arguments = np.linspace(0.0, front, 300)
    before = frames(walkers, arguments)
    half = forth[len(forth) // 3]
    _, walkers = led(FIELD, np.vstack([straight(forth[-1], half, 5.0), resting(half)]), walkers)
    middle = float(walker_of(walkers).argument[0])
    assert 0.2 * trail[-1, 0] < middle < 0.6 * trail[-1, 0]
    assert path_front(walker_of(walkers).path) == front
    ahead = forth[-1] + 0.04 * np.array([np.cos(before[-1, 2]), np.sin(before[-1, 2]), 0.0])
    hands = np.vstack([straight(half, forth[-1], 5.0), straight(forth[-1], ahead, 2.0), resting(ahead)])
    _, walkers = led(FIELD, hands, walkers)
    np.testing.assert_array_equal(frames(walkers, arguments), before)
    assert walker_of(walkers).argument[0] > trail[-1, 0] + 1.0


def test_endless_walk_has_constant_memory_and_retraces_what_it_stores():
    t = np.arange(0.0, 75.0, RATE)
    radius = 2.2 / WALKING.scale
    angle = np.clip(t - 0.5, 0.0, None) * 0.55
    c, s = np.cos(WALKING.heading), np.sin(WALKING.heading)
    x, y = radius * np.sin(angle), radius * (1.0 - np.cos(angle))
    circle = np.column_stack([WALKING.start[0] + c * x - s * y, WALKING.start[1] + s * x + c * y, 0.0 * t])
    trail, walkers = led(FIELD, circle)
    assert trail[-1, 0] > ROWS * STEP
    assert np.isfinite(trail).all()
    assert len(walkers.state) == len(WALKING.fresh())
    radii = np.hypot(*(frames(walkers, trail[-4000:, 0])[:, :2] / WALKING.scale - circle[:, :2].mean(axis=0)).T)
    assert np.ptp(radii) < 0.15 * radius
    oldest = path_back(walker_of(walkers).path)
    assert oldest > 5.0
    returning, walkers = led(FIELD, circle[::-1], walkers)
    assert returning[-1, 0] >= oldest
    assert returning[-1, 0] < oldest + 3.0


def test_repeated_tick_changes_nothing():
    _, walkers = led(FIELD, s_shaped(WALKING)[:1500])
    program, wrenches = FIELD.program(), np.empty((2, 6))
    hand = HandState.at([0.0, 0.0, 0.0], t=2.0).vector()
    memory, arguments = program.fresh_memory(), []
    for wrench in wrenches:
        feed_walkers(walkers, program.params, memory, hand)
        evaluate(*program.compiled(), memory, hand, wrench)
        arguments.append(float(walker_of(walkers).argument[0]))
    assert arguments[0] == arguments[1]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Leading(WALKING, k_l=-1.0), "k_l must be finite and at least 0 N/m, got -1.0"),
        (lambda: Walking(_WALK, scale=0.0), "scale"),
        (lambda: Walking(_WALK, heading=np.nan), "heading must be finite"),
        (lambda: Walking(_WALK, turn_one=2.0), "no faster on one foot than on two"),
        (lambda: Gait(1.0, np.inf, np.array([1, 2]), 0.3), "speed"),
        (lambda: Gait(1.0, 1.0, np.array([1, 3]), 0.3), "0, 1 or 2 feet"),
    ],
)
def test_invalid_arguments_raise_parameter_error(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


def test_laws_that_lead_the_same_figure_share_one_walker():
    field = FIELD + Leading(WALKING, k_l=0.0, k_z=0.0, b=1.0)
    program, hands = field.program(), s_shaped(WALKING)
    assert len(program.fresh_walkers().state) == len(WALKING.fresh())
    trail, walkers = led(FIELD, hands)
    trail_of_both, shared = led(field, hands)
    # These hands have no velocity for the other law to damp; the nearest point is searched twice a tick.
    np.testing.assert_allclose(trail_of_both, trail, atol=1e-9)
    np.testing.assert_allclose(shared.state, walkers.state, atol=1e-9)
