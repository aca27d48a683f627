"""The recorder's process: takes the servo's rows from a ring, runs the twin on them, and writes them.

It may end or hang without effect on the servo. Rows that it does not take in time are lost, which the recording
shows: the channel `tick` jumps, and `dropped` counts them.
"""

import errno
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from models.world.scene import SceneConfig
from sim.hardware.gated_servo import CHANNELS, ROW_SIZE, columns
from sim.hardware.process_start import parent_id
from sim.hardware.shared import Ring, SharedNumbers
from sim.hardware.twin import TWIN_CHANNELS, Twin
from sim.recording.recorder import DiskFull, Group, Recorder
from sim.recording.recording import RecordingError
from sim.world.linkage import Linkage

RECORDER_ROWS, RECORDER_DROPPED, RECORDER_ERROR, RECORDER_FORCE, RECORDER_APART = 0, 1, 2, 3, 6
RECORDER_READY, RECORDER_SIZE = 7, 8
"""Places in the recorder's status: rows written and dropped, errno of the error that stopped it, the hand's force (3)
[N], distance from twin to device [m], and 1 once it is ready: compiling the twin may take longer than the ring holds
rows, so the servo starts only then."""

RING_SECONDS = 5.0
"""Time for which the ring holds rows [s]: the recorder may stall for this long without loss."""

_POLL_INTERVAL = 0.02  # [s] polling interval of the ring


@dataclass(frozen=True)
class RecordingJob:
    """What a recorder is to write.

    Parameters
    ----------
    path : Path
        File to create.
    config, static : mapping
        Those of `sim.recording.recorder.Recorder`.
    seed : int
        Likewise.
    scene : SceneConfig
        Parameters of the twin's world, including the servo's period.
    linkage : Linkage
        Friction and added inertia of the twin.
    """

    path: Path
    config: Mapping[str, object]
    static: Mapping[str, npt.ArrayLike | str]
    seed: int
    scene: SceneConfig
    linkage: Linkage


def record_rows(job: RecordingJob, rows: Ring, orders: SharedNumbers, report: SharedNumbers) -> None:
    """Record until `orders` holds a 1, or the parent process has ended, and no row is left; target of a process.

    A full disk, or any other error of writing, ends the recording and is in `report`; the servo is not affected.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    status, order, parent = np.zeros(RECORDER_SIZE), np.zeros(1), parent_id()
    twin = Twin(job.scene, job.linkage)
    twin.follow(columns(np.zeros((0, ROW_SIZE))))
    try:
        # Channels: the servo's rows, how many of them were dropped so far, and the twin's.
        groups = {"ticks": Group(1.0 / job.scene.servo_period, CHANNELS | {"dropped": ()} | TWIN_CHANNELS)}
        with Recorder(job.path, job.config, job.seed, groups, job.static) as recorder:
            status[RECORDER_READY] = 1.0
            report.write(status)
            while True:
                orders.read(order)
                is_ending = order[0] > 0.0 or os.getppid() != parent
                taken, lost = rows.take()
                status[RECORDER_DROPPED] += lost
                if len(taken):
                    channels = columns(taken)
                    channels |= {"dropped": np.full(len(taken), status[RECORDER_DROPPED])} | twin.follow(channels)
                    recorder.append("ticks", channels)
                    status[RECORDER_ROWS] += len(taken)
                    status[RECORDER_FORCE : RECORDER_FORCE + 3] = channels["hand_force"][-1]
                    status[RECORDER_APART] = channels["apart"][-1]
                report.write(status)
                if is_ending and not len(taken):
                    break
                time.sleep(_POLL_INTERVAL)
            recorder.flush()
            recorder.close({"rows": int(status[RECORDER_ROWS]), "dropped": int(status[RECORDER_DROPPED])})
        if os.getppid() != parent and not status[RECORDER_ROWS]:
            job.path.unlink(missing_ok=True)  # no other process is left to remove it, and it would look like a run
    except (OSError, RuntimeError, RecordingError) as error:
        error_number = errno.ENOSPC if isinstance(error, DiskFull) else errno.EIO
        status[RECORDER_ERROR] = float(getattr(error, "errno", None) or error_number)
        report.write(status)
        os._exit(1)  # a normal exit would let HDF5 write again
