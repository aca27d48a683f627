"""The digital twin follows the device and estimates the force of the hand."""

import itertools

import numpy as np
import pytest

from controllers.safety.arming import ARM
from models.phantom.dynamics import mass_matrix
from models.world.scene import SceneConfig
from sim.hardware.gated_servo import Ticker
from sim.hardware.twin import RESIDUAL_GAIN, Twin, momentum_residual
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm
from sim.world.linkage import Linkage
from tests.sim.hardware.emulation import UNRAMPED_GATE, gated_servo, run

PUSH = Push(2.0, 1.0, 1.5, (0.3, -0.5, 0.81))
PERIOD = SceneConfig().servo_period


@pytest.fixture(scope="module")
def pushed() -> tuple[dict, dict]:
    rows = run(Ticker(gated_servo(arm=Arm(pushes=(PUSH,)), **UNRAMPED_GATE)), 4000, request=ARM)
    return rows, Twin(SceneConfig(), Linkage()).follow(rows)


def test_prediction_of_a_tick_is_within_encoder_resolution(pushed) -> None:
    rows, twin = pushed
    assert not rows["fault"].any()
    assert np.sqrt(np.mean(twin["apart"][300:] ** 2)) < 5e-5


def test_hand_force_is_the_filtered_push_and_otherwise_zero(pushed) -> None:
    """The estimate is the true force behind a first-order low-pass of rate K, here discretised exactly."""
    _, twin = pushed
    t = np.arange(4000) * PERIOD
    true = np.where((t > 2.0) & (t < 3.0), 1.5 * np.sin(np.pi * (t - 2.0)) ** 2, 0.0)[:, None] * np.array(
        PUSH.direction
    )
    true /= max(1.0, np.linalg.norm(PUSH.direction))
    decay = np.exp(-RESIDUAL_GAIN * PERIOD)
    response = (1.0 - decay) * decay ** np.arange(200)
    filtered = np.array([np.convolve(x, response)[:4000] for x in true.T]).T
    error = np.linalg.norm(twin["hand_force"] - filtered, axis=1)
    assert np.abs(twin["hand_force"]).max() > 1.0
    assert np.sqrt(np.mean(error[500:] ** 2)) < 0.08


def test_block_sizes_do_not_change_the_result(pushed) -> None:
    rows, whole = pushed
    twin, cuts = Twin(SceneConfig(), Linkage()), [0, 1, 20, 333, 1000, 4000]
    parts = [twin.follow({k: v[a:b] for k, v in rows.items()}) for a, b in itertools.pairwise(cuts)]
    for name, channel in whole.items():
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), channel)


def test_observer_restarts_where_ticks_are_missing(pushed) -> None:
    rows, _ = pushed
    indices = np.r_[0:1000, 1500:2500]
    twin = Twin(SceneConfig(), Linkage()).follow({k: v[indices] for k, v in rows.items()})
    assert twin["apart"][1000] == 0.0
    assert np.isfinite(twin["hand_force"]).all()
    assert np.sqrt(np.mean(twin["apart"][1300:] ** 2)) < 5e-5


@pytest.mark.parametrize("coulomb", [5e-3, 13.5e-3])  # published: 8.6e-3 and 6.8e-3 N m
def test_known_friction_lowers_the_force_estimated_where_no_hand_is(coulomb: float) -> None:
    linkage = Linkage((coulomb,) * 3)
    rows = run(Ticker(gated_servo(linkage=linkage, **UNRAMPED_GATE)), 3000, request=ARM)
    published, known = (
        np.median(np.linalg.norm(Twin(SceneConfig(), each).follow(rows)["hand_force"][500:], axis=1))
        for each in (Linkage(), linkage)
    )
    assert known < 0.8 * published


def test_known_inertia_is_part_of_the_momentum() -> None:
    """Without friction and gravity's change: a joint that is accelerated by its motor alone has no residual."""
    inertia, period, torque = 5e-4, 1e-3, np.array([0.02, 0.0, 0.0])
    for added, found in ((inertia, 0.0), (0.0, -0.02 * inertia / (inertia + mass_matrix((0.0, 0.0, 0.0))[0][0]))):
        memory, rate = np.zeros(7), 0.0
        for _ in range(500):
            momentum_residual.py_func(
                memory, (0.0, 0.0, 0.0), (rate, 0.0, 0.0), torque,
                np.array([np.zeros(3), np.zeros(3), [added, 0.0, 0.0]]), period, RESIDUAL_GAIN,
            )  # fmt: skip
            rate += period * torque[0] / (inertia + mass_matrix((0.0, 0.0, 0.0))[0][0])
        assert memory[0] == pytest.approx(found, abs=1e-6)
