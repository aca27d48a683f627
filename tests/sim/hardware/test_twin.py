"""The twin goes where the device goes, and tells what the hand does."""

import itertools

import numpy as np
import pytest

from controllers.safety.arming import ARM
from models.world.scene import SceneConfig
from sim.hardware.gated_servo import Ticker
from sim.hardware.twin import Twin
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm
from tests.sim.hardware.emulation import AT_ONCE, gated_servo, run

PUSH = Push(2.0, 1.0, 1.5, (0.3, -0.5, 0.81))


@pytest.fixture(scope="module")
def pushed() -> tuple[dict, dict]:
    rows = run(Ticker(gated_servo(arm=Arm(pushes=(PUSH,)), **AT_ONCE)), 4000, request=ARM)
    return rows, Twin(SceneConfig()).follow(rows)


def test_the_twin_predicts_a_tick_within_the_encoders_resolution(pushed) -> None:
    rows, twin = pushed
    assert not rows["fault"].any()
    assert np.sqrt(np.mean(twin["apart"][300:] ** 2)) < 5e-5


def test_the_hand_s_force_is_found_where_it_pushes_and_where_it_does_not(pushed) -> None:
    _, twin = pushed
    t = np.arange(4000) * 1e-3
    true = np.where((t > 2.0) & (t < 3.0), 1.5 * np.sin(np.pi * (t - 2.0)) ** 2, 0.0)[:, None] * np.array(
        PUSH.direction
    )
    true /= max(1.0, np.linalg.norm(PUSH.direction))
    late = np.array([np.convolve(x, np.exp(-np.arange(200) * 1e-3 * 62.8) * 0.0609)[:4000] for x in true.T]).T
    error = np.linalg.norm(twin["hand_force"] - late, axis=1)
    assert np.abs(twin["hand_force"]).max() > 1.0
    assert np.sqrt(np.mean(error[500:] ** 2)) < 0.08


def test_blocks_of_any_size_give_the_same(pushed) -> None:
    rows, whole = pushed
    twin, cuts = Twin(SceneConfig()), [0, 1, 20, 333, 1000, 4000]
    parts = [twin.follow({k: v[a:b] for k, v in rows.items()}) for a, b in itertools.pairwise(cuts)]
    for name, channel in whole.items():
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), channel)


def test_a_twin_begins_again_where_ticks_are_missing(pushed) -> None:
    rows, _ = pushed
    kept = np.r_[0:1000, 1500:2500]
    twin = Twin(SceneConfig()).follow({k: v[kept] for k, v in rows.items()})
    assert twin["apart"][1000] == 0.0
    assert np.isfinite(twin["hand_force"]).all()
    assert np.sqrt(np.mean(twin["apart"][1300:] ** 2)) < 5e-5
