"""Persons and populations: parameters within published intervals, seeded, and otherwise refused in one line."""

from dataclasses import fields, replace

import numpy as np
import pytest

from controllers.errors import ParameterError
from sim.errors import SimError
from sim.users.participant import Participant, tremor_filter
from sim.users.person.body import arm_matrices, check_steps
from sim.users.person.person import INTERVALS, Person
from sim.users.person.population import PERSONAS, persona, population
from sim.users.person.random_numbers import initial_rng, normal, uniform


def test_every_parameter_of_a_person_has_an_interval_with_a_source() -> None:
    numbers = {option.name for option in fields(Person)} - {"name", "hand"}
    assert numbers == set(INTERVALS)
    assert all(interval.source and interval.least < interval.most for interval in INTERVALS.values())


def test_population_depends_on_its_seed_and_larger_ones_extend_smaller_ones() -> None:
    assert population(3, 7) == population(5, 7)[:3]
    assert population(3, 7) != population(3, 8)
    assert persona("7:2") == population(3, 7)[2]
    assert persona("expert") is PERSONAS["expert"]


def test_population_statistics_follow_the_literature() -> None:
    people = population(400, 3)
    age, delay = np.array([p.age for p in people]), np.array([p.visual_delay for p in people])
    skill, noise = np.array([p.skill for p in people]), np.array([p.motor_noise for p in people])
    assert 0.05 < np.mean([p.hand == "left" for p in people]) < 0.16
    assert np.corrcoef(age, delay)[0, 1] > 0.3
    assert np.corrcoef(skill, noise)[0, 1] < -0.3
    assert age.min() >= 20.0
    assert age.max() <= 75.0


@pytest.mark.parametrize("name", sorted(INTERVALS))
def test_parameter_outside_its_interval_is_refused_with_what_is_expected(name: str) -> None:
    for wrong in (INTERVALS[name].most * 1.01 + 1e-3, INTERVALS[name].least - 0.01, float("nan")):
        with pytest.raises(SimError, match=name) as refused:
            Person(**{name: wrong})
        assert "expected" in str(refused.value)
        assert "\n" not in str(refused.value)


def test_unknown_persona_or_invalid_population_is_refused() -> None:
    for name in ("nobody", "7:x", "-1", "1:99999999999", "7" * 5000):
        with pytest.raises(SimError, match="median, expert"):
            persona(name)
    with pytest.raises(ParameterError, match=r"mass of person .median. is 1000.*; expected a number"):
        Person(mass=10**400)
    with pytest.raises(SimError, match="expected right or left"):
        Person(hand="both")  # pyright: ignore[reportArgumentType]
    for number, seed in ((0, 1), (3, -1)):
        with pytest.raises(SimError, match="expected"):
            population(number, seed)


def test_arm_matrices_are_positive_definite_and_mirrored_for_the_other_hand() -> None:
    mirror = np.diag([1.0, -1.0, 1.0])
    for person in population(20, 1):
        for ours, theirs in zip(
            arm_matrices(person),
            arm_matrices(replace(person, hand="left" if person.hand == "right" else "right")),
            strict=True,
        ):
            assert np.linalg.eigvalsh(ours)[0] > 0.0
            np.testing.assert_allclose(theirs, mirror @ ours @ mirror, atol=1e-12)


def test_steps_too_long_for_the_person_are_refused() -> None:
    with pytest.raises(SimError, match="physics step"):
        check_steps(Person(grip_stiffness=3000.0, grip_damping=20.0), 1e-3)
    with pytest.raises(SimError, match="reflex"):
        check_steps(Person(reflex_gain=0.5, reflex_delay=0.06, damping_ratio=0.1, stiffness=800.0, mass=0.1), 1e-4)
    with pytest.raises(SimError, match="servo period"):
        Participant().holding(0.02, 1e-4)


def test_random_numbers_are_uniform_normal_and_reproducible() -> None:
    state, again = initial_rng(5), initial_rng(5)
    drawn = np.array([normal(state) for _ in range(20_000)])
    np.testing.assert_array_equal(drawn[:50], [normal(again) for _ in range(50)])
    assert abs(drawn.mean()) < 0.03
    assert abs(drawn.std() - 1.0) < 0.02
    even = np.array([uniform(state) for _ in range(20_000)])
    assert abs(even.mean() - 0.5) < 0.01
    assert abs(np.var(even) - 1.0 / 12.0) < 0.003


def test_tremor_filter_has_its_amplitude_at_its_frequency() -> None:
    person, period = Person(tremor=0.1, tremor_frequency=8.0), 1e-3
    a, b, gain = tremor_filter(person, period)
    response = gain / np.abs(np.fft.fft([1.0, -a, -b], 1 << 18))
    frequency = np.fft.fftfreq(len(response), period)
    assert abs(abs(frequency[np.argmax(response)]) - 8.0) < 0.2
    assert np.sqrt(3.0 * np.mean(response**2)) == pytest.approx(0.1, rel=1e-3)
