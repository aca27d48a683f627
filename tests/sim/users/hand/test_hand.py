"""The simulated hand: a force in closed form, and no knowledge of the field."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from sim.errors import SimError
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm, hand_force


def force_of(arm: Arm, t: float, p: list[float], v: list[float] | None = None) -> np.ndarray:
    force = np.full(3, np.nan)
    hand_force(arm.compiled(), t, np.array(p), np.array(v or [0.0, 0.0, 0.0]), force)
    return force


def test_relaxed_hand_gives_no_force() -> None:
    np.testing.assert_array_equal(force_of(Arm(), 1.0, [0.1, 0.2, 0.3], [1.0, 0.0, 0.0]), np.zeros(3))


def test_tracing_hand_is_a_spring_damper_about_its_path() -> None:
    t = np.arange(0.0, 1.0, 0.01)
    path = np.stack((0.1 * t, np.zeros_like(t), 0.05 * t), axis=1)
    arm = Arm(stiffness=200.0, damping=3.0, path=path, period=0.01)
    p, v = np.array([0.02, 0.01, 0.0]), np.array([0.0, 0.2, 0.1])
    wanted, speed = np.array([0.1, 0.0, 0.05]) * 0.455, np.array([0.1, 0.0, 0.05])
    expected = 200.0 * (wanted - p) + 3.0 * (speed - v)
    np.testing.assert_allclose(force_of(arm, 0.455, list(p), list(v)), expected, rtol=1e-9)


def test_path_ends_at_rest() -> None:
    arm = Arm(path=np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), period=0.1)
    np.testing.assert_allclose(force_of(arm, 5.0, [0.1, 0.0, 0.0]), np.zeros(3), atol=1e-12)


def test_push_is_a_smooth_bump_in_its_direction() -> None:
    arm = Arm(pushes=(Push(1.0, 0.5, 4.0, direction=(0.0, 3.0, 4.0)),))
    unit = np.array([0.0, 0.6, 0.8])
    for t, share in ((0.999, 0.0), (1.0, 0.0), (1.125, 0.5), (1.25, 1.0), (1.375, 0.5), (1.501, 0.0)):
        np.testing.assert_allclose(force_of(arm, t, [0.0, 0.0, 0.0]), 4.0 * share * unit, atol=1e-9)


def test_push_without_direction_points_away_from_the_vertical_axis() -> None:
    arm = Arm(pushes=(Push(0.0, 1.0, 2.0),))
    np.testing.assert_allclose(force_of(arm, 0.5, [0.03, -0.04, 0.2]), [1.2, -1.6, 0.0], atol=1e-12)
    assert np.isfinite(force_of(arm, 0.5, [0.0, 0.0, 0.1])).all()


def test_push_at_a_place_waits_until_the_hand_arrives() -> None:
    compiled = Arm(
        pushes=(Push(1.0, 0.4, 3.0, direction=(1.0, 0.0, 0.0), place=(0.1, 0.0, 0.0), radius=0.02),)
    ).compiled()
    force, v = np.zeros(3), np.zeros(3)

    def at(t: float, x: float) -> float:
        hand_force(compiled, t, np.array([x, 0.0, 0.0]), v, force)
        return float(force[0])

    assert at(0.5, 0.1) == 0.0  # there, but too early
    assert at(1.5, 0.0) == 0.0  # late enough, but not there
    assert at(2.0, 0.09) == pytest.approx(0.0)  # begins here
    assert at(2.2, 0.3) == pytest.approx(3.0)  # and goes on wherever the hand is taken
    assert at(2.5, 0.1) == 0.0


@pytest.mark.parametrize(
    "push",
    [
        {"at": -1.0, "seconds": 1.0, "force": 1.0},
        {"at": 0.0, "seconds": 0.0, "force": 1.0},
        {"at": 0.0, "seconds": 1.0, "force": float("nan")},
        {"at": 0.0, "seconds": 1.0, "force": 1.0, "direction": (0.0, 0.0, 0.0)},
        {"at": 0.0, "seconds": 1.0, "force": 1.0, "direction": (1.0, 0.0)},
        {"at": 0.0, "seconds": 1.0, "force": 1.0, "place": (0.0, 0.0, 0.0), "radius": 0.0},
    ],
)
def test_invalid_push_is_refused(push: dict[str, float]) -> None:
    with pytest.raises((SimError, ParameterError)):
        Push(**push)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("arm", [{"stiffness": -1.0}, {"damping": float("inf")}, {"path": np.zeros((3, 2))}])
def test_invalid_arm_is_refused(arm: dict[str, object]) -> None:
    with pytest.raises(SimError):
        Arm(**arm)  # pyright: ignore[reportArgumentType]
