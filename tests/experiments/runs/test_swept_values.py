"""Numbers of a simulation that a sweep or a search sets, by their path."""

import numpy as np
import pytest

import hvf
from experiments.runs.sweep import with_values
from tests.experiments.runs.simulations import CURVE, level, simulation


def test_gain_of_one_law_in_a_composed_field_is_set() -> None:
    sim = simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0))
    other = with_values(sim, {"field.k_r": 100.0, "seed": 3, "clock.physics_step": 5e-4})
    assert (other.seed, other.clock.physics_step) == (3, 5e-4)
    hand = hvf.HandState.at([0.04, 0.0, -0.01])
    by_hand = (hvf.Follow(CURVE, k_r=100, b_d=8) + level).limited(8.0)
    np.testing.assert_array_equal(other.field.wrench(hand).force, by_hand.wrench(hand).force)
    assert sim.field.program().laws[0].k_r == 300  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize("path", ["field.k", "field.level.k"])
def test_parameter_of_own_law_is_set(path: str) -> None:
    sim = simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0))
    hand = hvf.HandState.at([0.04, 0.0, -0.01])
    by_hand = (hvf.Follow(CURVE, k_r=300, b_d=8) + level(k=80.0)).limited(8.0)
    np.testing.assert_array_equal(with_values(sim, {path: 80.0}).field.wrench(hand).force, by_hand.wrench(hand).force)
    alone = with_values(simulation(level), {"field.k": 80.0})
    np.testing.assert_array_equal(alone.field.wrench(hand).force, level(k=80.0).wrench(hand).force)
    with pytest.raises(hvf.ParameterError, match=r"law level .* has no parameter b"):
        with_values(sim, {"field.level.b": 1.0})


def test_force_bound_of_limited_field_is_set() -> None:
    sim = simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0))
    hand = hvf.HandState.at([0.1, 0.0, -0.01])
    for path, bounds in (("force", (2.0,)), ("torque", (8.0, 0.1))):
        by_hand = (hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(*bounds)
        other = with_values(sim, {f"field.limited.{path}": bounds[-1]})
        np.testing.assert_array_equal(other.field.program().params, by_hand.params)
        np.testing.assert_array_equal(other.field.wrench(hand).force, by_hand.wrench(hand).force)
    assert np.linalg.norm(sim.field.wrench(hand).force) == pytest.approx(8.0)
    for field, path, message in (
        (level + level, "limited.force", r"^field.limited.force: .* limited 0 times; expected limited.force or"),
        (level.limited(1.0).limited(2.0), "limited.force", "is limited 2 times"),
        (level.limited(1.0), "limited.power", "expected limited.force or limited.torque"),
        (level.limited(1.0), "limited", "expected limited.force or limited.torque"),
        (level.limited(1.0), "force", "0 laws of the field have 'force'; expected one among level, or limited$"),
    ):
        with pytest.raises(hvf.ParameterError, match=message):
            with_values(simulation(field), {f"field.{path}": 1.0})
    with pytest.raises(hvf.ParameterError, match=r"field.limited.force must be at least 0 N, got -1"):
        with_values(sim, {"field.limited.force": -1.0})


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("field.stiffness", "0 laws of the field have 'stiffness'; expected one among Follow, level"),
        ("clock.rate", "Clock has no 'rate'; expected some of servo_period, physics_step"),
        ("speed", "Simulation has no 'speed'"),
    ],
)
def test_unknown_path_is_named(path: str, message: str) -> None:
    with pytest.raises(hvf.ParameterError, match="^" + path) as error:
        with_values(simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + level), {path: 1.0})
    assert message in str(error.value)


def test_invalid_sweep_tuning_or_record_arguments_are_refused() -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8))
    with pytest.raises(hvf.ParameterError, match="threads is 0"):
        next(hvf.sweep(sim, {"field.k_r": [100.0]}, threads=0))
    with pytest.raises(hvf.ParameterError, match="record is empty"):
        sim.run(0.1, record="")
    with pytest.raises(hvf.ParameterError, match="the space is empty"):
        hvf.tune(sim, {}, lambda run: 1.0)
    for bounds in ((500.0, 50.0), (50.0,), (50.0, float("inf"))):
        with pytest.raises(hvf.ParameterError, match=r"^field\.k_r is .*expected the lowest and the highest value"):
            hvf.tune(sim, {"field.k_r": bounds}, lambda run: 1.0)  # pyright: ignore[reportArgumentType]


def test_number_within_a_sequence_is_refused() -> None:
    push = hvf.User(pushes=[hvf.Push(at=0.0, seconds=0.1, force=1.0)])
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8), user=push)
    with pytest.raises(hvf.ParameterError, match=r"user\.pushes is a list; expected whole values of user\.pushes"):
        with_values(sim, {"user.pushes.force": 2.0})
