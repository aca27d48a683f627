"""The digital twin follows the device and estimates the force of the hand."""

import itertools

import numpy as np
import pytest

from controllers.safety.arming import ARM
from models.world.scene import SceneConfig
from sim.hardware.gated_servo import Ticker
from sim.hardware.twin import RESIDUAL_GAIN, Twin
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm
from tests.sim.hardware.emulation import UNRAMPED_GATE, gated_servo, run

PUSH = Push(2.0, 1.0, 1.5, (0.3, -0.5, 0.81))
PERIOD = SceneConfig().servo_period


@pytest.fixture(scope="module")
def pushed() -> tuple[dict, dict]:
    rows = run(Ticker(gated_servo(arm=Arm(pushes=(PUSH,)), **UNRAMPED_GATE)), 4000, request=ARM)
    return rows, Twin(SceneConfig()).follow(rows)


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
    twin, cuts = Twin(SceneConfig()), [0, 1, 20, 333, 1000, 4000]
    parts = [twin.follow({k: v[a:b] for k, v in rows.items()}) for a, b in itertools.pairwise(cuts)]
    for name, channel in whole.items():
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), channel)


def test_observer_restarts_where_ticks_are_missing(pushed) -> None:
    rows, _ = pushed
    indices = np.r_[0:1000, 1500:2500]
    twin = Twin(SceneConfig()).follow({k: v[indices] for k, v in rows.items()})
    assert twin["apart"][1000] == 0.0
    assert np.isfinite(twin["hand_force"]).all()
    assert np.sqrt(np.mean(twin["apart"][1300:] ** 2)) < 5e-5
