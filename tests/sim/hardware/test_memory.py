"""What the servo's loop leaves behind in memory: nothing; and what it takes for the time of a tick."""

import gc
import multiprocessing
import resource
import socket
import sys
import tracemalloc
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from controllers.safety.arming import ARM, State
from sim.devices.exchange import READING_SEQUENCE, READING_SIZE, READING_THETA
from sim.hardware.emulated_process import EmulatedDriver
from sim.hardware.gated_servo import ROW_SIZE, Ticker
from sim.hardware.servo_process import (
    ORDER_BEAT,
    ORDER_NUMBER,
    ORDER_REQUEST,
    ORDER_SIZE,
    Channels,
    ServoClock,
    ServoProcess,
)
from sim.hardware.shared import Ring, SharedNumbers
from tests.sim.hardware.emulation import AT_ONCE, gated_servo

TICKS, WARM = 10_000, 3_000
TRANSIENT = 8_192
"""Bytes that a tick may hold at once beyond what it keeps, of Python's: packets, numbers, frames of calls."""


@pytest.fixture
def turns() -> Iterator[Callable[[int], State]]:
    """Runs the servo's loop for so many ticks, on a device of packets that answers each command; tells its state."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    orders, status, rows = SharedNumbers(ORDER_SIZE), SharedNumbers(ROW_SIZE), Ring(100, ROW_SIZE)
    told, heard = multiprocessing.get_context("spawn").Pipe(duplex=False)
    parts = gated_servo(EmulatedDriver(ours), dead_man=False, **AT_ONCE)
    ticker = Ticker(parts)
    process = ServoProcess(ticker, Channels(orders, status, rows, heard), ServoClock(late=60.0, heartbeat=60.0))
    command, packet, order = np.zeros(4), np.zeros(READING_SIZE + 1), np.zeros(ORDER_SIZE)
    order[[ORDER_BEAT, ORDER_NUMBER, ORDER_REQUEST]] = 1.0, 1.0, ARM
    orders.write(order)
    done = [0]

    def run(ticks: int) -> State:
        for k in range(done[0], done[0] + ticks):
            packet[0:2] = k + 1.0, k * 1e-3
            packet[READING_THETA] = 0.05 * np.sin(k * 1e-3)
            theirs.send(packet)
            process.turn(k + 1, 0.0)
            theirs.recv_into(command)
        done[0] += ticks
        return ticker.state

    assert READING_SEQUENCE == 0
    yield run
    parts.driver.close()
    for end in (theirs, told, heard, orders, status, rows):
        end.close()


def page_faults() -> int:
    """Of this process so far: pages that the system had to give it."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt


@pytest.mark.slow
def test_ten_thousand_ticks_leave_no_block_of_memory_behind(turns) -> None:
    _nrt_python.memsys_enable_stats()
    gc.collect()
    gc.disable()
    try:
        turns(WARM)  # lists of free numbers fill, which the collection has emptied
        compiled, before, faults = rtsys.get_allocation_stats(), sys.getallocatedblocks(), page_faults()
        state = turns(TICKS)
        after, now, more = sys.getallocatedblocks(), rtsys.get_allocation_stats(), page_faults() - faults
    finally:
        gc.enable()
        _nrt_python.memsys_disable_stats()
    made, freed = now.alloc - compiled.alloc, now.free - compiled.free
    print(f"{after - before} blocks, {more} page faults; compiled: {made / TICKS:.1f} a tick, {made - freed} kept")
    assert state is State.ACTIVE
    assert abs(after - before) < 100  # not one in a hundred ticks
    assert made == freed
    assert made <= 4 * TICKS  # work arrays: a stack of forces, and three to search for the closest point
    assert more < 100


@pytest.mark.slow
def test_a_tick_holds_a_few_kilobytes_at_most_while_it_runs(turns) -> None:
    turns(500)
    gc.disable()
    tracemalloc.start()
    try:
        turns(500)
        most = 0
        for _ in range(500):
            tracemalloc.reset_peak()
            held = tracemalloc.get_traced_memory()[0]
            turns(1)
            most = max(most, tracemalloc.get_traced_memory()[1] - held)
    finally:
        tracemalloc.stop()
        gc.enable()
    print(f"{most} bytes at most in a tick")
    assert most < TRANSIENT
