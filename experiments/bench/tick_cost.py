"""Cost of a closed-loop tick in units of one bare `mj_step` of the same world, mode by mode.

The bare steps are those of the same run: its recorded controls are replayed through the same compiled loop, in which
then only `mj_step` takes time. So contacts and constraints are the same at every tick.
"""

import threading
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple, get_args

import mujoco
import numpy as np

from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from sim.loop.channels import make_logs
from sim.loop.servo import FrameLog, TickLog, run_block
from sim.world.world import FigureKind

PHYSICS_STEP = 1e-3  # [s] physics step: one per servo tick, the fewest possible
RUN_SECONDS, ROUNDS = 1.0, 5  # [s] of a run, and number of runs
_THREAD_ROUNDS = 7  # runs on one and on two threads, of which the fastest count
SLICE_TICKS = 50  # ticks that are run before they are replayed, so that both see the same load of the machine

MODES: Mapping[str, Callable[[], RunConfig]] = {
    "follow": lambda: run_config(physics_step=PHYSICS_STEP),
    "follow, four clips that walk": lambda: run_config(clips=("walk",) * 4, physics_step=PHYSICS_STEP),
    "bunny": lambda: run_config(mode="bunny", physics_step=PHYSICS_STEP),
    "stretch": lambda: run_config(mode="stretch", physics_step=PHYSICS_STEP),
    "rivers, a clip each": lambda: run_config(mode="rivers", map="rivers", physics_step=PHYSICS_STEP),
    "lead": lambda: run_config(mode="lead", physics_step=PHYSICS_STEP),
    "composite": lambda: run_config(map="composite", clips=("walk", "angry", "cheer"), physics_step=PHYSICS_STEP),
    "gaze and lean": lambda: run_config(expressive=True, user="turn", physics_step=PHYSICS_STEP),
    "soft walls": lambda: run_config(walls=True, physics_step=PHYSICS_STEP),
    "a simulated person": lambda: run_config(person="median", user="trace", physics_step=PHYSICS_STEP),
}
"""All kinds of laws, maps and hands, also the expensive ones; the figure is updated every other tick, at 500 Hz."""


class TickCost(NamedTuple):
    """Processor time of a closed-loop tick and of a bare step [s], means over a run, and whether states agreed."""

    tick: float
    step: float
    same: bool


def tick_cost(config: RunConfig) -> TickCost:
    """Measure a run and the replay of its controls, in turns of `SLICE_TICKS` ticks.

    Every round repeats the same work, slice by slice, so the time of a slice is its minimum over the rounds: other
    processes only add to it.
    """
    closed_loop_times, bare_times, states_agree, substeps = [], [], True, 1
    for _ in range(ROUNDS):
        session, other = wire(config), wire(config)
        ticks, frames = make_logs(session.servo, SLICE_TICKS)
        _, unused = make_logs(other.servo, SLICE_TICKS)
        begins = range(0, round(RUN_SECONDS / session.servo.plant.period), SLICE_TICKS)
        times = [
            (timed(session, k, SLICE_TICKS, False, ticks, frames), timed(other, k, SLICE_TICKS, True, ticks, unused))
            for k in begins
        ]
        closed_loop_times.append([time[0] for time in times])
        bare_times.append([time[1] for time in times])
        states_agree = states_agree and bool((session.world.data.qpos == other.world.data.qpos).all())
        substeps = session.servo.plant.substeps
    tick, replayed = (float(np.min(rounds, axis=0).mean()) / SLICE_TICKS for rounds in (closed_loop_times, bare_times))
    return TickCost(tick, replayed / substeps, states_agree)


def _prepared(make: Callable[[], Session]) -> tuple[Session, TickLog, FrameLog, int]:
    """A session that has not been run, logs for `RUN_SECONDS` of it, and the number of ticks."""
    session = make()
    n = round(RUN_SECONDS / session.servo.plant.period)
    return session, *make_logs(session.servo, n), n


def timed(session: Session, first: int, n: int, replay: bool, ticks: TickLog, frames: FrameLog) -> float:
    """Processor time of this thread for n ticks from the tick `first` [s]."""
    begin = time.thread_time()
    run_block(session.servo, first, n, replay, ticks, frames)
    return time.thread_time() - begin


def thread_scaling(make: Callable[[], Session]) -> float:
    """Throughput of two threads with a session each, over twice that of one; the shortest times of all rounds count."""
    alone_times, pair_times = list[float](), list[float]()
    for _ in range(_THREAD_ROUNDS):
        alone, pair = _prepared(make), [_prepared(make) for _ in range(2)]
        threads = [
            threading.Thread(target=run_block, args=(session.servo, 0, n, False, ticks, frames))
            for session, ticks, frames, n in pair
        ]
        begin = time.perf_counter()
        session, ticks, frames, n = alone
        run_block(session.servo, 0, n, False, ticks, frames)
        alone_times.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        pair_times.append(time.perf_counter() - begin)
    return min(alone_times) / min(pair_times)


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
