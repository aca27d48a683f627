"""LEADING: golden trajectories of the default hand that leads a walk along an S and straight back, and of the figure.

Run this file to rewrite them after an intended change.
"""

import json
from pathlib import Path

import numpy as np

from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import feed_walkers
from controllers.state import HAND_POSITION, HAND_SIZE, HAND_VELOCITY
from controllers.walking.gait import Gait
from controllers.walking.walker import walker_at
from experiments.config.modes import Lead
from experiments.setups.modes.lead import leading
from experiments.setups.parts.leading_hand import leading_hand
from sim.users.hand.arm import hand_force

GOLDEN = Path(__file__).with_name("lead.json")
GAIT = Gait(1.375, 1.25, np.repeat([2, 1, 2, 1], [18, 48, 18, 48]), 0.47)
MASS, PERIOD, SECONDS, EVERY = 0.15, 1e-3, 19.0, 250


def _run() -> dict[str, list]:
    field = leading(Lead(), GAIT)
    program, arm = field.program(), leading_hand(field).compiled()
    memory, hand, wrench, user = program.fresh_memory(), np.zeros(HAND_SIZE), np.zeros(6), np.zeros(3)
    walkers = program.fresh_walkers()
    walker = walker_at.py_func(walkers.state, 0)
    p, v, trajectory = np.array([*field.walking.start, 0.001]), np.zeros(3), []
    for k in range(round(SECONDS / PERIOD)):
        hand[0] = k * PERIOD
        hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3] = p, v
        feed_walkers(walkers, program.params, memory, hand)
        evaluate(*program.compiled(), memory, hand, wrench)
        hand_force(arm, k * PERIOD, p, v, user)
        if k % EVERY == 0:
            trajectory.append([*p.tolist(), float(walker.argument[0])])
        v = v + PERIOD / MASS * (wrench[:3] + user)
        p = p + PERIOD * v
    return {"ways": trajectory}


def test_lead_trajectories_match_golden_values() -> None:
    golden, now = np.array(json.loads(GOLDEN.read_text(encoding="utf-8"))["ways"]), np.array(_run()["ways"])
    # A start displaced by 1 nm displaces the hand by 1 nm and the figure by 4 nm.
    np.testing.assert_allclose(now[:, :3], golden[:, :3], atol=1e-8)
    np.testing.assert_allclose(now[:, 3], golden[:, 3], atol=1e-6)
    # Along the S and back.
    assert now[:, 3].max() > 5.0
    assert abs(now[-1, 3]) < 0.1


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(_run()) + "\n", encoding="utf-8")
