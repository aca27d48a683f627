"""Runs a trial, from its configuration to its row; the same on threads, in processes and on a cluster."""

import os
import platform
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from llvmlite.binding import get_host_cpu_name

from experiments.config.maps import Composite, Cylindrical
from experiments.config.part import from_json, to_dict
from experiments.config.run_config import RunConfig
from experiments.results.folder import RECORDING
from experiments.setups.modes.follow import flows_parallel
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.part_types import MapParts
from experiments.setups.session import Session
from experiments.setups.wiring import Ready, wire
from experiments.trials.trial.measures import TrialLog, measure_trial
from sim.loop.channels import groups, record_into
from sim.recording.recorder import DiskFull, Recorder

State = Literal["done", "failed"]


class Task(NamedTuple):
    """A trial for a worker: key, configuration as JSON, and folder or URL for its recording, or empty."""

    key: str
    config: str
    recordings: str = ""


class Row(NamedTuple):
    """The result of a trial, as a worker returns it.

    Attributes
    ----------
    key : str
        Key of the trial.
    state : {"done", "failed"}
        Whether the trial was completed.
    reason : str
        Why it failed; empty if it did not.
    measures : dict of str to float
        See `experiments.trials.trial.measures`.
    seconds : float
        Processor time of the trial [s].
    worker, processor : str
        Host and process that ran it, and model of the processor.
    """

    key: str
    state: State
    reason: str
    measures: dict[str, float]
    seconds: float
    worker: str
    processor: str


class MapCache:
    """Cache of haptic maps that several runs share; a cached map is only read.

    Clips, alignment and blends of a map take ten times as long as the rest of a trial's set-up.
    """

    def __init__(self) -> None:
        self._maps: dict[object, MapParts[Any]] = {}
        self._locks: dict[object, threading.Lock] = {}
        self._lock = threading.Lock()

    def session(self, config: RunConfig, ready: Ready = lambda units: None) -> Session:
        """Assemble a run with the map from the cache, which is made first if it is missing."""
        key = _map_key(config)
        with self._lock:
            lock = self._locks.setdefault(key, threading.Lock())
        if key not in self._maps:
            with lock:
                if key not in self._maps:
                    session = wire(config, ready=ready)
                    # The map was already refined when this session was assembled.
                    self._maps[key] = replace(session.parts.maps, refined=None)
        return wire(config, ready=ready, maps_of=lambda config, figure, clips: self._maps[key])


def _map_key(config: RunConfig) -> object:
    """Key of the settings that a map depends on: map, flow and figure about a circle, else all but seed and user."""
    figure = (config.figure.kind == "none", config.figure.stature, config.figure.mass)
    if isinstance(config.map, Cylindrical | Composite):
        return config.map, flows_parallel(resolved(config)), figure  # the flow moves a hand that is pushed off
    return replace(config, seed=1, user=type(config.user)(does=config.user.does)), figure


MAP_CACHE = MapCache()
"""The cache of this process."""


def perform_trial(task: Task, maps: MapCache = MAP_CACHE) -> Row:
    """Run a trial and measure it; an error in the trial gives a row with its reason.

    Errors of the machine rather than the trial are raised, so that the trial can be tried again.

    Raises
    ------
    OSError, MemoryError, DiskFull
        If the machine lacks something.
    """
    worker, start = f"{platform.node()}:{os.getpid()}", time.thread_time()
    try:
        config = from_json(RunConfig, task.config, "a trial's configuration")
        measures = _run_trial(config, task, maps)
    except (OSError, MemoryError, DiskFull):
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        return Row(task.key, "failed", reason, {}, time.thread_time() - start, worker, get_host_cpu_name())
    return Row(task.key, "done", "", measures, time.thread_time() - start, worker, get_host_cpu_name())


def _run_trial(config: RunConfig, task: Task, maps: MapCache) -> dict[str, float]:
    session = maps.session(config)
    log = TrialLog(session.servo, session.world)
    if not task.recordings:
        return _simulate(config, session, log)
    with tempfile.TemporaryDirectory(prefix="hvf-") as folder:
        measures = run_recorded(config, session, log, Path(folder))
        _copy_to_url(Path(folder) / RECORDING, f"{task.recordings.rstrip('/')}/{task.key}.h5")
    return measures


def _simulate(config: RunConfig, session: Session, log: TrialLog) -> dict[str, float]:
    session.loop(log).run(config.seconds)
    return measure_trial(config, session, log)


def run_recorded(config: RunConfig, session: Session, log: TrialLog, folder: Path) -> dict[str, float]:
    """Run a trial, record it into an existing folder, and measure it."""
    servo, static = session.servo, session.static()
    with Recorder(folder / RECORDING, to_dict(config), config.seed, groups(servo, session.world), static) as recorder:
        record = record_into(recorder, servo, session.world)

        def observe(ticks: Any, frames: Any, n: int) -> None:
            log(ticks, frames, n)
            record(ticks, frames, n)

        session.loop(observe).run(config.seconds)
        measures = measure_trial(config, session, log)
        recorder.close({"lines": [], "measures": measures})
    return measures


def _copy_to_url(file: Path, url: str) -> None:
    import fsspec  # an optional dependency, needed for recordings only

    with fsspec.open(url, "wb") as target:
        target.write(file.read_bytes())  # pyright: ignore[reportAttributeAccessIssue]
