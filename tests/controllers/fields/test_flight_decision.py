"""The decision of a led figure to fly: taken by its pace at the start of a stance, carried out within it."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.fields.algebra.walker_feed import feed_walkers
from controllers.fields.leading import Leading
from controllers.walking.gait import TRANSITION_FRACTION, Gait, decide_flight, fresh_decision, share_of_stance
from controllers.walking.walker import walker_at
from controllers.walking.walking import Walking

RUN = Gait(2.2, 3.0, np.repeat([1, 0, 1, 0], [32, 12, 32, 12]), 0.6)
WALKING = Walking(RUN, (-0.06, 0.0), scale=160.0, forward=1.05)
RATE = 1e-3


def decided(shares, speed, memory=None):
    memory = fresh_decision(True) if memory is None else memory
    held = []
    for share in shares:
        decide_flight(memory, share, speed, 2.7, 2.5)
        held.append(memory[0])
    return np.array(held), memory


def test_stances_are_intervals_with_a_foot_on_the_floor():
    np.testing.assert_allclose(RUN.stances, [[0.0, 32 / 88], [0.5, 32 / 88]])
    turned = Gait(2.2, 3.0, np.roll(RUN.support, -10), 0.6)
    np.testing.assert_allclose(np.sort(turned.stances[:, 0]), [34 / 88, 78 / 88])
    table = turned.stances.ravel()
    shares = np.array([share_of_stance(table, lap) for lap in (np.arange(176) + 0.5) / 88])
    np.testing.assert_array_equal(shares >= 0.0, np.tile(turned.support, 2) > 0)
    assert share_of_stance(table, -1.0 + 40.5 / 88) == pytest.approx(share_of_stance(table, 40.5 / 88))
    assert Gait(1.4, 1.25, np.array([2, 1]), 0.4).stances.shape == (0, 2)


@pytest.mark.parametrize(("speed", "ends"), [(2.8, 0.0), (2.6, 1.0), (-2.9, 1.0)])
def test_grounded_figure_takes_off_above_the_take_off_pace(speed, ends):
    _, memory = decided([-1.0], speed)
    held, _ = decided(np.linspace(0.0, 1.0, 201), speed, memory)
    assert held[0] == 1.0
    assert held[-1] == ends
    # The end of the stance is the clip's own push-off.
    assert np.all(held[np.linspace(0.0, 1.0, 201) > TRANSITION_FRACTION] == ends)


@pytest.mark.parametrize(("speed", "ends"), [(2.6, 0.0), (2.4, 1.0)])
def test_flying_figure_lands_below_the_landing_pace(speed, ends):
    held, memory = decided([-1.0], 3.0, np.zeros(4))
    held, memory = decided(np.linspace(0.0, 1.0, 201), speed, memory)
    assert held[-1] == pytest.approx(ends, abs=1e-12)
    # The start of the stance is the clip's own landing.
    assert np.all(held[np.linspace(0.0, 1.0, 201) < 1.0 - TRANSITION_FRACTION] == 0.0)


def test_decision_holds_during_the_stance_and_in_the_air():
    _, memory = decided([-1.0], 3.0)
    _, memory = decided(np.linspace(0.0, 0.3, 50), 3.0, memory)
    held, memory = decided(np.linspace(0.3, 1.0, 50), 0.5, memory)
    assert held[-1] == 0.0
    held, _ = decided(np.full(10, -1.0), 0.5, memory)
    np.testing.assert_array_equal(held, 0.0)


def test_moving_back_in_a_stance_reverses_the_blend():
    _, memory = decided([-1.0], 3.0)
    shares = np.linspace(0.0, 0.6, 61)
    there, memory = decided(shares, 3.0, memory)
    back, _ = decided(shares[::-1], -1.0, memory)
    np.testing.assert_allclose(back, there[::-1], atol=1e-14)


def led(seconds):
    """Argument, flight blend and speed (n, 3) for a hand that leads straight at the gait's pace for 3 s and stops."""
    program = Leading(WALKING).program()
    memory, walkers, hand = program.fresh_memory(), program.fresh_walkers(), np.zeros(15)
    hand[4] = 1.0
    walker = walker_at.py_func(walkers.state, 0)
    trail = np.empty((round(seconds / RATE), 3))
    for k in range(len(trail)):
        hand[0] = k * RATE
        hand[1] = WALKING.start[0] + min(hand[0], 3.0) * RUN.speed / WALKING.scale
        feed_walkers(walkers, program.params, memory, hand)
        trail[k] = walker.argument[0], walker.argument[1], walker.speed[0]
    return trail


def test_led_figure_flies_only_at_flying_pace():
    s, held, speed = led(7.0).T
    lap = s / RUN.stride
    flying = RUN.support[(88 * (lap - np.floor(lap))).astype(int)] == 0
    assert held[0] == 1.0
    assert held[-1] == 1.0
    assert held.min() == 0.0
    # In the air the blend is 0 or 1, and the pace in flight is nearly that of the decision.
    assert np.minimum(held[flying], 1.0 - held[flying]).max() < 1e-6
    flown = flying & (held < 1e-6)
    assert flown.sum() > 200
    assert speed[flown].min() > 0.75 * RUN.speed
    assert speed[flown].max() <= 1.05 * RUN.speed
    # In flight it hardly accelerates.
    acceleration = np.abs(np.diff(speed)) / RATE
    assert acceleration[held[1:] < 0.5].max() < 1.001 * WALKING.flight_pull
    assert acceleration.max() == pytest.approx(WALKING.pull, rel=1e-3)
    # The blend changes smoothly with the argument.
    assert np.abs(np.diff(held)).max() < 0.012


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"landing": 0.95}, "takes off at no lower pace"),
        ({"flight_pull": 0.0}, "flight_pull"),
        ({"take_off": np.nan}, "take_off"),
    ],
)
def test_invalid_flight_parameters_raise_parameter_error(numbers, message):
    with pytest.raises(ParameterError, match=message):
        Walking(RUN, **numbers)
