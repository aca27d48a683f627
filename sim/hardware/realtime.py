"""What Linux gives a process that must not be late, and waiting for a moment."""

import ctypes
import gc
import os
import time

PRIORITY = 80
"""Of SCHED_FIFO, above the threads of interrupts (50)."""
SPIN = 150e-6
"""How long before a deadline a process wakes and looks at the clock instead of sleeping [s]."""

_MCL_CURRENT, _MCL_FUTURE = 1, 2


def become_realtime() -> list[str]:
    """Ask for SCHED_FIFO and for memory that stays, turn the garbage collector off; says what was got and what not.

    Returns
    -------
    list of str
        One sentence each.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    said: list[str] = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        said.append(f"The servo runs before other processes (SCHED_FIFO, priority {PRIORITY}).")
    except (OSError, AttributeError) as error:
        said.append(
            f"The servo runs like any process, and will be late now and then: SCHED_FIFO was refused "
            f"({error}); expected CAP_SYS_NICE, or an rtprio for this user in /etc/security/limits.conf."
        )
    libc = ctypes.CDLL(None, use_errno=True)
    # Both at once: on its own a lock of what is to come would make later allocations fail at the limit.
    if hasattr(libc, "mlockall") and libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0:
        said.append("Its memory stays in RAM (mlockall).")
    else:
        reason = os.strerror(ctypes.get_errno())
        said.append(f"Its memory may be swapped out: mlockall was refused ({reason}); expected a higher memlock limit.")
    return said


def wait_until(deadline: float) -> float:
    """Wait until `time.monotonic` is at a deadline [s], the last `SPIN` awake; returns by how much it is past it [s].

    `time.sleep` is clock_nanosleep with an absolute time on Linux.
    """
    while True:
        left = deadline - time.monotonic()
        if left <= 0.0:
            return -left
        if left > SPIN:
            time.sleep(left - SPIN)
