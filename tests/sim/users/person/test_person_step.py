"""A person in compiled code: statics and delays in closed form, and runs determined by the seed."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit

from controllers.curves.trajectory import Trajectory
from controllers.kernel_call import call_as_given
from controllers.lent import by_pointer
from sim.devices.simulated import simulated_phantom
from sim.loop.loop import Loop
from sim.users.intents import Own, Trace, Wish
from sim.users.participant import Participant
from sim.users.person.body import arm_matrices
from sim.users.person.eye import Eye, seen_place
from sim.users.person.muscles import RECOVERY_RATE
from sim.users.person.person import Person
from sim.users.person.person_state import (
    BELIEF,
    CAPACITY,
    DIRECTION_ERROR_OFFSET,
    FELT_FORCE,
    HAND_V,
    REFLEX,
    PersonState,
)
from sim.users.person.person_step import link_person
from sim.users.person.senses import ERROR_TIME, OFFSET_TIME, advance_direction_error
from sim.users.person.wishes import ENGAGED, OWN, Wishes, following, resting
from sim.world.phantom_port import phantom_port
from tests.sim.bare_servos import CUTOFF, START, bare_servo, device_world, simulated

NOISELESS = Person(motor_noise=0.0, seen_noise=0.0, felt_noise=0.0, direction_noise=0.0, force_noise=0.0, tremor=0.0,
               correction=0.0)  # fmt: skip
PERIOD, STEP = 1e-3, 2.5e-4


@njit
def _held(person: PersonState, ticks: int, first: int, p: np.ndarray, force: np.ndarray, switch: np.ndarray) -> None:
    at_rest = np.zeros(3)
    for k in range(first, first + ticks):
        for i in range(round(PERIOD / STEP)):
            call_as_given(person.units[0], (by_pointer(person), k * PERIOD, STEP, i, p, at_rest, force, switch))


@njit
def _carried(person: PersonState, ticks: int, v: np.ndarray, force: np.ndarray, switch: np.ndarray) -> float:
    most = 0.0
    for k in range(ticks):
        for i in range(round(PERIOD / STEP)):
            t = k * PERIOD + i * STEP
            call_as_given(person.units[0], (by_pointer(person), k * PERIOD, STEP, i, t * v, v, force, switch))
        most = max(most, np.sqrt(np.sum(force**2)))
    return most


class ClampedPerson:
    """A person whose stylus the test holds at a point, in the compiled unit of a run."""

    def __init__(self, person: Person, wishes: Wishes):
        self.state = Participant(person, wishes, 1).holding(PERIOD, STEP)
        link_person(self.state)
        self.force, self.switch, self.ticks = np.zeros(3), np.zeros(1), 0

    def hold(self, p: np.ndarray, seconds: float) -> None:
        ticks = round(seconds / PERIOD)
        _held(self.state, ticks, self.ticks, p, self.force, self.switch)
        self.ticks += ticks


def test_arm_and_fingers_at_rest_are_springs_in_series() -> None:
    hand = ClampedPerson(NOISELESS, Wishes(following(np.zeros((2, 3)))))
    hand.hold(np.zeros(3), 0.3)
    moved = np.array([0.002, -0.001, 0.0015])
    hand.hold(moved, 3.0)
    _, stiffness, _ = arm_matrices(NOISELESS)
    series = np.linalg.inv(np.linalg.inv(stiffness) + np.eye(3) / NOISELESS.grip_stiffness)
    np.testing.assert_allclose(hand.force, -series @ moved, rtol=2e-3, atol=1e-4)


@pytest.mark.parametrize("person", [NOISELESS, replace(NOISELESS, stiffness=3.0 * NOISELESS.stiffness)])
def test_person_who_begins_in_motion_goes_on_with_it_unbraked(person: Person) -> None:
    v = np.array([0.07, 0.0, 0.0])
    hand = ClampedPerson(person, Wishes(following(0.02 * np.arange(50)[:, None] * v)))
    # To begin with muscles that drive to a standstill takes 0.5 N and more.
    assert _carried(hand.state, 400, v, hand.force, hand.switch) < 0.1


def test_reflex_and_belief_change_only_after_their_delays() -> None:
    hand = ClampedPerson(NOISELESS, Wishes(following(np.zeros((2, 3)))))
    hand.hold(np.zeros(3), 0.5)
    hand.hold(np.array([0.003, 0.0, 0.0]), NOISELESS.reflex_delay - 2e-3)
    assert np.abs(hand.state.vectors[[REFLEX, BELIEF, FELT_FORCE]]).max() < 1e-9
    hand.hold(np.array([0.003, 0.0, 0.0]), 0.02)
    assert hand.state.vectors[REFLEX, 0] < -1e-3
    assert hand.state.vectors[BELIEF, 0] > 1e-4
    assert hand.state.vectors[FELT_FORCE, 0] < -0.1


def test_felt_force_has_noise_proportional_to_it() -> None:
    rows, felt_place = resting(2), list[np.ndarray]()
    rows[0, ENGAGED] = 1.0
    hand = ClampedPerson(NOISELESS, Wishes(rows, OWN))
    hand.hold(np.array([0.02, -0.03, 0.03]), 1.0)
    for _ in range(300):
        hand.hold(np.array([0.02, -0.03, 0.03]), 0.05)
        felt_place.append(hand.state.vectors[FELT_FORCE] / hand.force)
    np.testing.assert_allclose(np.mean(felt_place), 1.0, atol=0.02)
    np.testing.assert_allclose(np.std(felt_place), NOISELESS.felt_force_noise, rtol=0.2)


@njit
def _direction_errors(person: PersonState, directions: np.ndarray) -> None:
    for k in range(len(directions)):
        advance_direction_error(person)
        directions[k] = person.vectors[DIRECTION_ERROR_OFFSET]


def test_direction_error_has_the_variance_of_filtered_noise() -> None:
    person = Participant(Person(), Wishes(resting(2)), 1).holding(PERIOD, STEP)
    speed, directions = 0.2, np.empty((2_000_000, 3))
    person.vectors[HAND_V] = 0.0, speed, 0.0
    _direction_errors(person, directions)
    # An Ornstein-Uhlenbeck process of time τ behind a filter of time T: σ² v² T² τ / (T + τ), none along the motion.
    variance = (Person().direction_noise * speed * OFFSET_TIME) ** 2 * ERROR_TIME / (OFFSET_TIME + ERROR_TIME)
    np.testing.assert_allclose(directions.std(axis=0), [variance**0.5, 0.0, variance**0.5], rtol=0.08, atol=1e-9)
    assert abs(np.mean(directions[:, 0] * directions[:, 2])) < 0.1 * variance


def test_relaxed_person_exerts_no_lasting_force() -> None:
    hand = ClampedPerson(NOISELESS, Wishes(resting(2)))
    hand.hold(np.zeros(3), 0.3)
    hand.hold(np.array([0.01, 0.0, 0.0]), 3.0)
    assert np.abs(hand.force).max() < 0.02


def test_force_is_limited_by_strength() -> None:
    hand = ClampedPerson(replace(NOISELESS, strength=3.0), Wishes(following(np.zeros((2, 3)))))
    hand.hold(np.zeros(3), 0.1)
    hand.hold(np.array([0.08, 0.0, 0.0]), 1.0)
    assert np.linalg.norm(hand.force) <= 3.0 + 1e-9


def test_held_force_tires_by_the_three_compartment_model() -> None:
    """While she holds a share f of strength, (1 − C)(t) = (F f/R)(1 − exp(−R t)); see `sim.users.person.muscles`."""
    person = replace(NOISELESS, strength=20.0, fatigue=4.0)
    hand = ClampedPerson(person, Wishes(following(np.zeros((2, 3)))))
    hand.hold(np.zeros(3), 0.1)
    hand.hold(np.array([0.04, 0.0, 0.0]), 1.0)
    began, load = hand.state.memory[CAPACITY], float(np.linalg.norm(hand.force)) / person.strength
    hand.hold(np.array([0.04, 0.0, 0.0]), 3.0)
    assert 0.2 < load < 0.9
    lost = 4.0 * load / RECOVERY_RATE * (1.0 - np.exp(-RECOVERY_RATE * 3.0 / 60.0))
    assert began - hand.state.memory[CAPACITY] == pytest.approx(lost, rel=0.02)


def test_strength_is_lost_only_with_fatigue() -> None:
    for fatigue, least, most in ((0.0, 1.0, 1.0), (4.0, 0.3, 0.95)):
        hand = ClampedPerson(replace(NOISELESS, strength=3.0, fatigue=fatigue), Wishes(following(np.zeros((2, 3)))))
        hand.hold(np.zeros(3), 0.1)
        hand.hold(np.array([0.08, 0.0, 0.0]), 5.0)
        assert least <= hand.state.memory[CAPACITY] <= most


PHASE = 2.0 * np.pi * np.arange(64) / 64
CIRCLE = 0.04 * np.stack([np.cos(PHASE), np.sin(PHASE), 0.0 * PHASE], axis=1)


def eye_of(effect: np.ndarray, p: np.ndarray, trust: float) -> Eye:
    """An eye that has learned a figure whose root is at effect @ p, and sees that of the place p."""

    def pose(p: np.ndarray) -> np.ndarray:
        return np.concatenate([effect @ p, np.tile([1.0, 0.0, 0.0, 0.0], 18)])

    inverse = np.zeros((3, 57))
    inverse[:, :3] = np.linalg.solve(effect.T @ effect + trust * np.eye(3), effect.T)
    unseen, n = np.eye(3) - inverse[:, :3] @ effect, len(CIRCLE)
    inverses, unseens = np.tile(inverse, (n, 1, 1)), np.tile(unseen, (n, 1, 1))
    return Eye(pose(p), np.array([pose(q) for q in CIRCLE]), CIRCLE, inverses, unseens, np.full(n, trust))


def test_eye_finds_the_place_of_a_pose() -> None:
    effect, place = 3.0 * np.random.default_rng(2).normal(size=(3, 3)), np.zeros(3)
    for p in (np.array([0.03, 0.02, 0.01]), np.array([-0.04, 0.001, -0.01])):
        seen_place(eye_of(effect, p, 0.0), p + 0.002, np.empty(57), place)
        np.testing.assert_allclose(place, p, atol=1e-12)


def test_unseen_directions_are_taken_from_the_felt_place() -> None:
    """Without noise the most likely place is the closed-form solution of the linear Gaussian problem."""
    effect, p, felt_place, place = (
        np.diag([50.0, 50.0, 0.0]),
        np.array([0.04, 0.0, 0.006]),
        np.array([0.043, -0.002, 0.007]),
        np.zeros(3),
    )
    seen_place(eye_of(effect, p, 1e-6), felt_place, np.empty(57), place)
    np.testing.assert_allclose(place, [p[0], p[1], felt_place[2]], atol=1e-6)
    effect, trust = np.diag([50.0, 30.0, 5.0]), 100.0
    seen_place(eye_of(effect, p, trust), felt_place, np.empty(57), place)
    likeliest = np.linalg.solve(effect.T @ effect + trust * np.eye(3), effect.T @ effect @ p + trust * felt_place)
    np.testing.assert_allclose(place, likeliest, atol=1e-9)


def servo_of(participant: Participant):
    world = device_world()
    port = phantom_port(world.model, world.data, world.config.servo_period, CUTOFF)
    state = participant.holding(world.config.servo_period, world.config.physics_step)
    return bare_servo(world, simulated_phantom(port, state)), world


def path_of(participant: Participant, seconds: float, block: float, **polling) -> np.ndarray:
    servo, world = servo_of(participant)
    rows: list[np.ndarray] = []
    Loop(servo, world, lambda ticks, frames, n: rows.append(ticks.hand[:n].copy()), block, **polling).run(seconds)
    return np.concatenate(rows)


def test_run_depends_on_its_seed_and_not_on_its_blocks() -> None:
    curve = Trajectory.circle(float(np.hypot(*START[:2])), 4.0)
    wishes = Trace().wishes(curve, 1.0, 1)
    first = path_of(Participant(Person(), wishes, 3), 0.6, 0.2)
    np.testing.assert_array_equal(first, path_of(Participant(Person(), wishes, 3), 0.6, 0.034))
    assert np.abs(first - path_of(Participant(Person(), wishes, 4), 0.6, 0.2)).max() > 1e-6


def test_own_intent_moves_the_hand_in_python_and_compiled() -> None:
    goal = START + np.array([0.01, 0.0, 0.0])

    def in_python(t, place, force):
        return Wish(goal, switch=t > 0.5)

    def compiled(t, place, force, rows):
        rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 9] = 0.03, 0.01, 0.0, 1.0

    ask_times: list[float] = []
    for own in (Own(in_python, every=0.1), Own(compiled, compiled=True)):
        participant = Participant(NOISELESS, own.wishes(Trajectory.circle(0.04, 4.0), 1.0, 1), 1, own)
        servo, world = servo_of(participant)
        person = servo.device.user.person  # pyright: ignore[reportAttributeAccessIssue]

        def ask(t: float) -> None:
            ask_times.append(t)
            own.ask(person, t)  # noqa: B023 - used within the turn

        polling = {} if own.compiled else {"ask": ask, "ask_seconds": own.every}
        rows: list[np.ndarray] = []
        Loop(servo, world, lambda ticks, frames, n: rows.append(ticks.hand[:n].copy()), **polling).run(1.0)  # noqa: B023
        assert np.concatenate(rows)[-1, 1] > START[0] + 0.002
    np.testing.assert_allclose(ask_times, 0.1 * np.arange(10), atol=1e-9)


def test_servo_without_a_person_needs_no_person_unit() -> None:
    assert simulated(device_world()).units() == ()
    assert len(servo_of(Participant())[0].device.units()) == 1  # pyright: ignore[reportAttributeAccessIssue]
