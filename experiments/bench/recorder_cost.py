"""Cost of recording relative to the recorded run, and growth of memory with the length of a run."""

import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import psutil

from experiments.config.options import run_config
from experiments.setups.wiring import wire
from sim.loop.channels import groups, record_into
from sim.loop.loop import Loop
from sim.recording.recorder import Recorder

_SHORT_RUN, _LONG_RUN = 2.0, 20.0  # [s] of a short and of a long run


class RecorderCost(NamedTuple):
    """Ratio of processor times with and without recorder, and of memory after and before a run ten times as long."""

    ratio: float
    grown: float


def recorder_cost() -> RecorderCost:
    """Measure both ratios on the demo's run."""
    _processor_time(0.1, True)
    alone, recorded = _processor_time(_SHORT_RUN, False), _processor_time(_SHORT_RUN, True)
    before = psutil.Process().memory_info().rss
    _processor_time(_LONG_RUN, True)
    return RecorderCost(recorded / alone, psutil.Process().memory_info().rss / before)


def _processor_time(seconds: float, recorded: bool) -> float:
    """Processor time of a run [s], all threads."""
    session = wire(run_config())
    with tempfile.TemporaryDirectory() as folder:
        if not recorded:
            begin = time.process_time()
            Loop(session.servo, session.world).run(seconds)
            return time.process_time() - begin
        with Recorder(Path(folder) / "run.h5", {}, 1, groups(session.servo), session.static()) as recorder:
            begin = time.process_time()
            Loop(session.servo, session.world, record_into(recorder, session.servo, session.world)).run(seconds)
            recorder.flush()
            return time.process_time() - begin
