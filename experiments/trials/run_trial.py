"""A trial, from its configuration to its row; the same on a thread, in a process, and on another machine."""

import os
import platform
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import mujoco
from llvmlite.binding import get_host_cpu_name

from experiments.config.maps import Composite, Cylindrical
from experiments.config.part import from_json, to_dict
from experiments.config.run_config import RunConfig
from experiments.results.folder import RECORDING
from experiments.setups.parts import MapParts
from experiments.setups.session import Session
from experiments.setups.wiring import Ready, wire
from experiments.trials.measures import measured_trial
from experiments.trials.trial_log import TrialLog
from models.mocap.clip import Clip
from sim.loop.loop import Loop, groups, record_into
from sim.recording.recorder import Recorder

State = Literal["done", "failed"]


class Task(NamedTuple):
    """What a worker is given.

    Attributes
    ----------
    key : str
        Of the trial.
    config : str
        Its configuration, as JSON.
    recordings : str
        Folder or URL that keeps its recording; empty for none.
    """

    key: str
    config: str
    recordings: str = ""


class Row(NamedTuple):
    """What a worker gives back.

    Attributes
    ----------
    key : str
        Of the trial.
    state : {"done", "failed"}
        Whether it came to its end.
    reason : str
        Why not.
    measures : dict of str to float
        See `experiments.trials.measures`.
    seconds : float
        Processor time that it took [s].
    worker, processor : str
        Who ran it, on what.
    """

    key: str
    state: State
    reason: str
    measures: dict[str, float]
    seconds: float
    worker: str
    processor: str


class Shelf:
    """Maps that have been made, for the runs on them that follow: they are read, never written.

    Clips, alignment and blends of a map take ten times as long as the rest of a trial's set-up.
    """

    def __init__(self) -> None:
        self._made: dict[object, MapParts[Any]] = {}
        self._locks: dict[object, threading.Lock] = {}
        self._lock = threading.Lock()

    def session(self, config: RunConfig, ready: Ready = lambda units: None) -> Session:
        """A run that is wired up, on a map from the shelf."""
        key = _shared(config)
        with self._lock:
            lock = self._locks.setdefault(key, threading.Lock())
        if key not in self._made:
            with lock:
                if key not in self._made:
                    session = wire(config, ready=ready)
                    # It was refined when the session was assembled.
                    self._made[key] = replace(session.parts.maps, refined=None)
        return wire(config, ready=ready, maps_of=self._maps_of(key))

    def _maps_of(self, key: object) -> Callable[[RunConfig, mujoco.MjModel, tuple[Clip, ...] | None], MapParts[Any]]:
        return lambda config, figure, clips: self._made[key]


def _shared(config: RunConfig) -> object:
    """What a map's parts depend on: of a map about a circle not the mode, of another one all but the hand."""
    figure = (config.figure.kind == "none", config.figure.stature, config.figure.mass)
    if isinstance(config.map, Cylindrical | Composite):
        return config.map, figure
    return replace(config, seed=1, user=type(config.user)(does=config.user.does)), figure


SHELF = Shelf()
"""Of this process."""


def perform(task: Task, shelf: Shelf = SHELF) -> Row:
    """Run a trial and measure it; one that raises is a row with its reason.

    What is wrong with the machine, not with the trial, is raised: it is no row, and another try may do better.

    Raises
    ------
    OSError, MemoryError
        If the machine lacks something.
    """
    worker, began = f"{platform.node()}:{os.getpid()}", time.thread_time()
    try:
        config = from_json(RunConfig, task.config, "a trial's configuration")
        measures = _run(config, task, shelf)
    except (OSError, MemoryError):
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        return Row(task.key, "failed", reason, {}, time.thread_time() - began, worker, get_host_cpu_name())
    return Row(task.key, "done", "", measures, time.thread_time() - began, worker, get_host_cpu_name())


def _run(config: RunConfig, task: Task, shelf: Shelf) -> dict[str, float]:
    session = shelf.session(config)
    log = TrialLog(session.servo, session.world)
    if not task.recordings:
        return _simulated(config, session, log)
    with tempfile.TemporaryDirectory(prefix="hvf-") as folder:
        measures = recorded(config, session, log, Path(folder))
        _keep(Path(folder) / RECORDING, f"{task.recordings.rstrip('/')}/{task.key}.h5")
    return measures


def _simulated(config: RunConfig, session: Session, log: TrialLog) -> dict[str, float]:
    laws = session.parts.program.python_laws
    Loop(session.servo, session.world, log, python_laws=laws).run(config.seconds)
    return measured_trial(config, session, log)


def recorded(config: RunConfig, session: Session, log: TrialLog, folder: Path) -> dict[str, float]:
    """Run a trial, recording it into a folder that is there, and measure it."""
    servo, laws = session.servo, session.parts.program.python_laws
    static = session.static()
    with Recorder(folder / RECORDING, to_dict(config), config.seed, groups(servo), static) as recorder:
        record = record_into(recorder, servo, session.world)

        def observe(ticks: Any, frames: Any, n: int) -> None:
            log(ticks, frames, n)
            record(ticks, frames, n)

        Loop(servo, session.world, observe, python_laws=laws).run(config.seconds)
        measures = measured_trial(config, session, log)
        recorder.close({"lines": [], "measures": measures})
    return measures


def _keep(file: Path, url: str) -> None:
    import fsspec  # an extra, that only whoever keeps recordings needs

    with fsspec.open(url, "wb") as target:
        target.write(file.read_bytes())  # pyright: ignore[reportAttributeAccessIssue]
