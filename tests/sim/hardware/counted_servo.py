"""A servo against the clock whose ticks' calls of the heap are counted: run with `heap_calls.c` preloaded.

With PYTHONMALLOC=malloc what Python takes comes from the same functions as what compiled code, NumPy, MuJoCo and libc
take, so nothing is hidden in a pool.
"""

import ctypes
import multiprocessing
import socket

import numpy as np

from controllers.safety.arming import ARM
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_THETA
from sim.hardware.emulated_process import EmulatedDriver
from sim.hardware.gated_servo import ROW_SIZE, GatedServo, Ticker
from sim.hardware.servo_process import (
    ORDER_BEAT,
    ORDER_NUMBER,
    ORDER_REQUEST,
    ORDER_SIZE,
    ORDER_STOP,
    Channels,
    ServoClock,
    ServoProcess,
)
from sim.hardware.shared import Ring, SharedNumbers
from tests.sim.hardware.emulation import AT_ONCE, gated_servo

WARM, TICKS = 500.0, 2000.0


class CountedServo(ServoProcess):
    """Counts after tick `WARM`, but for what the device does between two turns, and orders its end `TICKS` later."""

    def __init__(self, parts: GatedServo, theirs: socket.socket):
        self.orders, self.status, self.rows = SharedNumbers(ORDER_SIZE), SharedNumbers(ROW_SIZE), Ring(100, ROW_SIZE)
        _, self.heard = multiprocessing.get_context("spawn").Pipe(duplex=False)
        self.ticker, self.theirs, self.order = Ticker(parts), theirs, np.zeros(ORDER_SIZE)
        self.order[[ORDER_BEAT, ORDER_NUMBER, ORDER_REQUEST]] = 1.0, 1.0, ARM
        self.orders.write(self.order)
        self.heap = ctypes.CDLL(None)
        self.heap.heap_open.restype = self.heap.heap_close.restype = None
        self.heap.heap_calls.restype = ctypes.c_long
        self.command, self.packet = np.zeros(4), np.zeros(READING_SIZE + 1)
        clock = ServoClock(late=60.0, heartbeat=60.0, realtime=False)
        super().__init__(self.ticker, Channels(self.orders, self.status, self.rows, self.heard), clock)

    def turn(self, number: float, late: float) -> bool:
        self.heap.heap_close()
        self.packet[READING_SEQUENCE] += 1.0
        self.packet[READING_CLOCK] = number * 1e-3
        self.packet[READING_THETA] = 0.05 * np.sin(number * 1e-3)
        self.theirs.send(self.packet)
        if self._ticks > 0.0:
            self.theirs.recv_into(self.command)
        if self._ticks == WARM + TICKS:
            self.order[ORDER_STOP] = 1.0
            self.orders.write(self.order)
        elif self._ticks >= WARM:
            self.heap.heap_open()
        return ServoProcess.turn(self, number, late)  # `super()` would make an object

    def let_shared_go(self) -> None:
        self.close()
        for shared in (self.orders, self.status, self.rows):
            shared.close()


if __name__ == "__main__":
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    servo = CountedServo(gated_servo(EmulatedDriver(ours), dead_man=False, **AT_ONCE), theirs)
    servo.run()
    counted = servo.heap.heap_calls()
    servo.heap.heap_open()
    [float(k) for k in range(1000)]
    servo.heap.heap_close()
    print(servo.ticker.state.name, counted, servo.heap.heap_calls() - counted)
    servo.let_shared_go()
