"""STRETCHY TUBES, alone and then FOLLOW: golden paths and edits of a hand that bends the default curve and releases it.

Run this file to rewrite them after an intended change.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from controllers.fields.algebra.program import evaluate
from controllers.state import HAND_POSITION, HAND_SIZE, HAND_SWITCH, HAND_VELOCITY
from experiments.config.options import run_config
from experiments.setups.setups import map_parts, parts_of
from models.humanoid.skeleton import figure_model
from sim.users.hand.arm import hand_force

# Explicit, so that the golden paths do not depend on defaults.
BENDING = {"seek": 150.0, "rubber": 150.0, "tube_damping": 14.0, "rubber_tube": 0.008, "bump": 0.5}
MODES = {"stretch": {}, "stretch-then-follow": {"stiffness": 300.0, "damping": 4.0, "tube": 0.25}}
MASS, PERIOD, SECONDS, EVERY = 0.15, 1e-3, 17.0, 250


def _golden(mode: str) -> Path:
    return Path(__file__).with_name(mode.replace("-", "_") + ".json")


def _run(mode: str) -> dict[str, list]:
    config = run_config(mode, "composite", radius=0.0477, lap=4.0, reach=0.025, **BENDING, **MODES[mode])
    parts = parts_of(config, map_parts(config, figure_model()))
    field, curve, arm = parts.field, parts.maps.curve, parts.user.compiled()
    program = field.program()
    memory, hand, wrench, user = program.fresh_memory(), np.zeros(HAND_SIZE), np.zeros(6), np.zeros(3)
    p, v, path = curve.point(0.0), np.zeros(3), []
    for k in range(round(SECONDS / PERIOD)):
        hand[0], hand[HAND_SWITCH] = k * PERIOD, arm.switch[0]
        hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3] = p, v
        evaluate(*program.compiled(), memory, hand, wrench)
        hand_force(arm, k * PERIOD, p, v, user)
        if k % EVERY == 0:
            path.append(p.tolist())
        v = v + PERIOD / MASS * (wrench[:3] + user)
        p = p + PERIOD * v
    return {"path": path, "edits": field.edits(memory).tolist(), "held_off": field.held_off(memory)}


@pytest.mark.parametrize("mode", MODES)
def test_stretch_trajectories_and_edits_match_golden_values(mode: str) -> None:
    golden, now = json.loads(_golden(mode).read_text(encoding="utf-8")), _run(mode)
    np.testing.assert_allclose(now["path"], golden["path"], atol=1e-8)
    np.testing.assert_allclose(now["edits"], golden["edits"], atol=1e-8)
    assert len(now["edits"]) == 3
    assert now["held_off"] < 1e-9


if __name__ == "__main__":
    for name in MODES:
        _golden(name).write_text(json.dumps(_run(name)) + "\n", encoding="utf-8")
