"""Real-time scheduling and memory locking on Linux, and waiting for an absolute deadline."""

import ctypes
import gc
import os
import time

PRIORITY = 80
"""Priority under SCHED_FIFO, above interrupt threads (50)."""
BUSY_WAIT_TIME = 150e-6
"""Time before a deadline from which a process busy-waits instead of sleeping [s]."""

_MCL_CURRENT, _MCL_FUTURE = 1, 2


def become_realtime() -> list[str]:
    """Request SCHED_FIFO and locked memory, and turn the garbage collector off.

    Returns
    -------
    list of str
        One sentence for each request: whether it was granted, and if not, why.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    log: list[str] = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        log.append(f"The servo runs before other processes (SCHED_FIFO, priority {PRIORITY}).")
    except (OSError, AttributeError) as error:
        log.append(
            f"The servo runs like any process, and will be late now and then: SCHED_FIFO was refused "
            f"({error}); expected CAP_SYS_NICE, or an rtprio for this user in /etc/security/limits.conf."
        )
    libc = ctypes.CDLL(None, use_errno=True)
    # Both flags in one call: if only future pages were locked, later allocations would fail at the memlock limit.
    if hasattr(libc, "mlockall") and libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0:
        log.append("Its memory stays in RAM (mlockall).")
    else:
        reason = os.strerror(ctypes.get_errno())
        log.append(f"Its memory may be swapped out: mlockall was refused ({reason}); expected a higher memlock limit.")
    return log


def wait_until(deadline: float) -> float:
    """Wait until `time.monotonic` reaches a deadline [s], the last `BUSY_WAIT_TIME` busily; returns the lateness [s].

    `time.sleep` is clock_nanosleep with an absolute time on Linux.
    """
    while True:
        left = deadline - time.monotonic()
        if left <= 0.0:
            return -left
        if left > BUSY_WAIT_TIME:
            time.sleep(left - BUSY_WAIT_TIME)
