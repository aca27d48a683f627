"""Cost of a tick with a physical figure, a kinematic one and none, relative to a bare `mj_step`."""

import time
from typing import NamedTuple, get_args

import mujoco
import numpy as np

from experiments.config.options import run_config
from experiments.setups.wiring import wire
from sim.loop.loop import make_logs
from sim.loop.servo import run_block
from sim.world.world import FigureKind

_BLOCK_TICKS, _BLOCK_COUNT = 1000, 6  # ticks of a block, and blocks that are timed


class FigureCost(NamedTuple):
    """Processor time of a tick, by kind of figure, and of a step of the linkage alone [s]."""

    physical: float
    kinematic: float
    none: float
    bare_step: float


def figure_cost() -> FigureCost:
    """Measure the kinds in turn; each is the best of several blocks after a warm-up block."""
    sessions = {kind: wire(run_config(figure=kind)) for kind in get_args(FigureKind)}
    logs = {kind: make_logs(session.servo, _BLOCK_TICKS) for kind, session in sessions.items()}
    model, cost = sessions["none"].world.model, dict.fromkeys((*sessions, "bare_step"), np.inf)
    data = mujoco.MjData(model)
    data.qpos[:] = sessions["none"].world.data.qpos
    for block in range(_BLOCK_COUNT):
        for kind, session in sessions.items():
            begin = time.thread_time()
            run_block(session.servo, _BLOCK_TICKS * block, _BLOCK_TICKS, False, *logs[kind])
            if block > 0:
                cost[kind] = min(cost[kind], (time.thread_time() - begin) / _BLOCK_TICKS)
        begin = time.thread_time()
        mujoco.mj_step(model, data, _BLOCK_TICKS)
        cost["bare_step"] = min(cost["bare_step"], (time.thread_time() - begin) / _BLOCK_TICKS)
    return FigureCost(**cost)
