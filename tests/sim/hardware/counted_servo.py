"""Servos whose heap calls per tick are counted, one a device: run with `heap_calls.c` preloaded.

With PYTHONMALLOC=malloc Python allocates through the same functions as compiled code, NumPy, MuJoCo and libc, so that
no allocation is hidden in a pool.
"""

import ctypes
import multiprocessing
import socket
import sys
import time

import numpy as np

from controllers.safety.arming import ARM
from models.phantom.kinematics import L1
from sim.devices.dhd import DHD, DhdDevice
from sim.devices.driver import READ
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_THETA
from sim.devices.hdapi import HDAPI, HdapiDevice
from sim.devices.hid import HidPhantom
from sim.devices.hid_protocol import COUNT_UNIT
from sim.devices.hidapi_node import HidapiNode
from sim.hardware.emulated_process import EmulatedDriver
from sim.hardware.gated_servo import ROW_SIZE, Ticker
from sim.hardware.servo_process import (
    DETAIL_SIZE,
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
from tests.devices.firmware import calibration, identity
from tests.sim.hardware.emulation import UNRAMPED_GATE, gated_servo

WARM, TICKS = 500.0, 2000.0


def theta_at(number: float) -> float:
    return 0.05 * np.sin(number * 1e-3)


class Packets:
    """An emulated device at the other end of packets."""

    def __init__(self) -> None:
        ours, self.theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.driver, self.command, self.packet = EmulatedDriver(ours), np.zeros(4), np.zeros(READING_SIZE + 1)

    def pass_tick(self, number: float) -> None:
        if self.packet[READING_SEQUENCE] > 0.0:
            self.theirs.recv_into(self.command)
        self.packet[READING_SEQUENCE] += 1.0
        self.packet[READING_CLOCK], self.packet[READING_THETA] = number * 1e-3, theta_at(number)
        self.theirs.send(self.packet)


class Reports:
    """The reference firmware behind hidapi's functions."""

    def __init__(self, library: str):
        self.firmware = ctypes.CDLL(library)
        self.firmware.mock_begin(identity().tobytes(), calibration().tobytes())
        self.unit = 2.0 * np.pi / (calibration()["counts_per_turn"] * COUNT_UNIT)
        self.driver = HidPhantom(HidapiNode(self.firmware, "mock"), "mock")

    def pass_tick(self, number: float) -> None:
        counts = calibration()["zero"] + np.rint(np.array([theta_at(number), 0, 0, 0, 0, 0]) / self.unit)
        self.firmware.mock_tick(counts.astype(np.int32).tobytes())


class Frames:
    """A mock of HDAPI, whose thread runs by itself: the tick after one with a sample waits for the next sample."""

    def __init__(self, library: str):
        self.hd = HDAPI.load(library)
        self.hd.mock_reset()
        self.hd.mock_manual(0)
        assert self.hd.mock_is_counted()
        self.hd.mock_served.restype = ctypes.c_ulong
        self.driver, self.transform, self.next = HdapiDevice(self.hd), np.eye(4), 0.0

    def pass_tick(self, number: float) -> None:
        self.transform[3, 0] = 1e3 * theta_at(number) * L1
        self.hd.mock_pose(self.transform.ctypes)
        if number == self.next:
            self.next = 0.0
            return
        while self.hd.mock_served() <= self.driver.telemetry[READ]:
            time.sleep(1e-4)
        self.next = number + 1.0


class Poses:
    """A mock of DHD."""

    def __init__(self, library: str):
        self.dhd = DHD.load(library)
        self.dhd.mock_reset()
        self.driver, self.position, self.frame = DhdDevice(self.dhd), np.zeros(3), np.eye(3)

    def pass_tick(self, number: float) -> None:
        self.position[1] = theta_at(number) * L1
        self.dhd.mock_pose(self.position.ctypes, self.frame.ctypes)


DEVICES = {"packets": Packets, "HID": Reports, "HDAPI": Frames, "DHD": Poses}


class CountedServo(ServoProcess):
    """Counts from tick `WARM` on, except what the device does between two ticks, and stops `TICKS` later."""

    def __init__(self, device: Packets | Reports | Frames | Poses):
        self.orders, self.status, self.rows = SharedNumbers(ORDER_SIZE), SharedNumbers(ROW_SIZE), Ring(100, ROW_SIZE)
        _, reports = multiprocessing.get_context("spawn").Pipe(duplex=False)
        self.device, self.order = device, np.zeros(ORDER_SIZE)
        self.ticker = Ticker(gated_servo(device.driver, dead_man=False, **UNRAMPED_GATE))
        self.order[[ORDER_BEAT, ORDER_NUMBER, ORDER_REQUEST]] = 1.0, 1.0, ARM
        self.orders.write(self.order)
        self.heap = ctypes.CDLL(None)
        self.heap.heap_open.restype = self.heap.heap_close.restype = None
        self.heap.heap_calls.restype = ctypes.c_long
        clock = ServoClock(late=60.0, heartbeat=60.0, realtime=False)
        super().__init__(
            self.ticker, Channels(self.orders, self.status, self.rows, SharedNumbers(DETAIL_SIZE), reports), clock
        )

    def turn(self, number: float, late: float) -> bool:
        self.heap.heap_close()
        self.device.pass_tick(number)
        if self._ticks == WARM + TICKS:
            self.order[ORDER_STOP] = 1.0
            self.orders.write(self.order)
        elif self._ticks >= WARM:
            self.heap.heap_open()
        return ServoProcess.turn(self, number, late)  # `super()` would make an object


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        name, *library = argument.split("=")
        servo = CountedServo(DEVICES[name](*library))
        before = servo.heap.heap_calls()
        servo.run()
        counted = servo.heap.heap_calls()
        servo.heap.heap_open()
        [float(k) for k in range(1000)]
        servo.heap.heap_close()
        print(name, servo.ticker.state.name, counted - before, servo.heap.heap_calls() - counted)
        print(name, servo.ticker.fault, file=sys.stderr)
        servo.close()
        servo.device.driver.close()
        for shared in (servo.orders, servo.status, servo.rows):
            shared.close()
