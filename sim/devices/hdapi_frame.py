"""The compiled HDAPI callback of the vendor's scheduler thread, and the memory that it shares with the servo.

The scheduler's thread runs no Python, so it never waits for the GIL, and allocates nothing on the heap. Samples and
commands pass through sequence locks (`sim.compilation.sequence_lock`), errors through a pair of counters: neither side
waits for the other.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from numba import njit, types

from controllers.safety.faults import Fault, first_not_finite
from geometry.arrays import Array, IntArray
from sim.compilation.c_function import address_for_c, call_struct_head, call_void
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import int32_at, loader
from sim.compilation.python_clock import seconds
from sim.compilation.sequence_lock import barrier, read_whole, write_whole
from sim.devices.driver import READ
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA
from sim.devices.virtual_arm import place_stylus, tip_force

COMMAND_TIMEOUT = 5e-3
"""Watchdog: age of the last command beyond which the callback commands zero force [s]; five of its periods."""
MAX_ERRORS_PER_FRAME = 32
"""Largest number of errors fetched from the library per frame; the rest is fetched after the next frame."""

_DONE, _CONTINUE = np.uint32(0), np.uint32(1)
_BUTTONS, _POSITION, _VELOCITY, _TRANSFORM = np.uint32(0x2000), np.uint32(0x2050), np.uint32(0x2051), np.uint32(0x2052)
_MOTOR_TEMPERATURE, _CURRENT_FORCE, _FORCE_OUTPUT = np.uint32(0x2605), np.uint32(0x2700), np.uint32(0x4000)
_WARM_MOTORS, _EXCEEDED_VELOCITY = 0x0200, 0x0203
_FORCE_NOT_FINITE = int(Fault.FORCE_NOT_FINITE)

FUNCTIONS = (
    "hdBeginFrame", "hdEndFrame", "hdGetDoublev", "hdGetIntegerv", "hdSetDoublev", "hdEnable", "hdDisable",
    "hdGetError",
)  # fmt: skip
"""The library's functions in the order of `HdMemory.functions`; the clock's address follows them."""
_BEGIN, _END, _GET_DOUBLES, _GET_INTEGERS, _SET_DOUBLES, _ENABLE, _DISABLE, _GET_ERROR, _CLOCK = range(9)

N_CLOSING, N_PRESSED, N_ENABLED, N_ERRORS_RAISED, N_ERRORS_TAKEN, N_SIZE = range(6)
"""Places in `HdMemory.numbers`: 1 to end the callback; the buttons, as an int; 1 while the motors are on; number of
errors that the callback has raised, and number of those that the servo has taken."""
ERROR_CODE, ERROR_VALUE, ERROR_SIZE = range(3)
"""Places in `HdMemory.error`: its number, and its value: a temperature [share of the highest], a speed [m/s], or the
number again."""
SAMPLE_POSITION, SAMPLE_TRANSFORM, SAMPLE_VELOCITY, SAMPLE_BUTTONS, SAMPLE_CLOCK, SAMPLE_NUMBER = 0, 3, 19, 22, 23, 24
SAMPLE_SIZE = 25
"""Places in a sample: tip [mm], transform of the stylus by columns (as in OpenGL), velocity [mm/s], buttons, the clock
[s], and the frame's number, from 1 on."""
COMMAND_ENABLE, COMMAND_CLOCK, COMMAND_SIZE = 3, 4, 5
"""Places in a command, after the force in P [N]: 1 if the motors are to be on, and the time of the command [s]."""
IO_NEW, IO_CODE, IO_FAULT, IO_VALUE, IO_ENABLE, IO_SIZE = range(6)
"""Places in `HdMemory.io`: 1 if there is a new sample; the library's error; the fault of a pose or a torque; the
value of either; 1 if the motors are to be on."""


class LockedNumbers(NamedTuple):
    """Numbers shared through a sequence lock.

    Attributes
    ----------
    changes, shared : array
        Count of changes and shared numbers (`sim.compilation.sequence_lock`).
    written, whole, read : Array
        The writer's private copy, and the reader's scratch and result.
    """

    changes: IntArray
    shared: Array
    written: Array
    whole: Array
    read: Array

    @classmethod
    def fresh(cls, size: int) -> "LockedNumbers":
        """A lock over `size` zeros."""
        return cls(np.zeros(1, np.int64), *(np.zeros(size) for _ in range(4)))


class HdMemory(NamedTuple):
    """The state of a device, shared by its driver in the servo and the callback in the vendor's thread.

    Attributes
    ----------
    functions : IntArray
        Addresses of the library's functions and of the clock, see `FUNCTIONS`.
    device : int
        The library's handle.
    largest : float
        The device's nominal force [N].
    numbers : IntArray
        See `N_CLOSING`.
    sample, command : LockedNumbers
        See `SAMPLE_POSITION`, `COMMAND_ENABLE`. The callback writes samples, the servo writes commands.
    force, heat : Array
        Owned by the callback: the force that it sends [N], and the motors' temperatures, shapes (3,) and (6,).
    error : Array
        See `ERROR_CODE`. Owned by the servo from when it is raised until it is taken, else by the callback.
    frame, reading, torque, io, telemetry : Array
        Owned by the servo: the stylus's orientation in H (3, 3), the last valid reading, the torques to be commanded
        [N m], results of the kernels (see `IO_NEW`), and the driver's telemetry.
    """

    functions: IntArray
    device: int
    largest: float
    numbers: IntArray
    sample: LockedNumbers
    command: LockedNumbers
    force: Array
    heat: Array
    error: Array
    frame: Array
    reading: Array
    torque: Array
    io: Array
    telemetry: Array

    @classmethod
    def fresh(cls, functions: list[int], device: int, largest: float, telemetry: Array) -> "HdMemory":
        """Memory of a device with its motors off, before the first sample."""
        return cls(
            np.array(functions, np.int64), device, largest, np.zeros(N_SIZE, np.int64),
            LockedNumbers.fresh(SAMPLE_SIZE), LockedNumbers.fresh(COMMAND_SIZE),
            np.zeros(3), np.zeros(6), np.zeros(ERROR_SIZE), np.zeros((3, 3)),
            np.zeros(READING_SIZE), np.zeros(3), np.zeros(IO_SIZE), telemetry,
        )  # fmt: skip


_memory_at: Any = loader(numba.typeof(HdMemory.fresh([], 0, 0.0, np.zeros(1))))


@njit
def _take_errors(get_error: int) -> int:
    """Take up to `MAX_ERRORS_PER_FRAME` errors off the library's error stack; returns the first, 0 if there is none."""
    first = 0
    for _ in range(MAX_ERRORS_PER_FRAME):
        code = call_struct_head(get_error)
        if code == 0:
            break
        if first == 0:
            first = code
    return first


@njit
def _report_error(hd: HdMemory, code: int) -> None:
    """Store an error for the servo, unless the servo has not taken the previous one yet."""
    numbers, error, sample = hd.numbers, hd.error, hd.sample.written
    if numbers[N_ERRORS_RAISED] != numbers[N_ERRORS_TAKEN]:
        return
    error[ERROR_CODE] = error[ERROR_VALUE] = code
    if code == _WARM_MOTORS:
        call_void(hd.functions[_GET_DOUBLES], (_MOTOR_TEMPERATURE, hd.heat.ctypes.data))
        error[ERROR_VALUE] = hd.heat.max()
    elif code == _EXCEEDED_VELOCITY:
        x, y, z = sample[SAMPLE_VELOCITY], sample[SAMPLE_VELOCITY + 1], sample[SAMPLE_VELOCITY + 2]
        error[ERROR_VALUE] = np.sqrt(x * x + y * y + z * z) * 1e-3
    barrier()
    numbers[N_ERRORS_RAISED] += 1


@entry_point
def serve_frame(memory: int) -> np.uint32:
    """The scheduler's callback, with the address of an `HdMemory`: read the state, command the force."""
    hd = _memory_at(memory)
    functions, numbers, sample, command = hd.functions, hd.numbers, hd.sample.written, hd.command.read
    if numbers[N_CLOSING] != 0:
        return _DONE
    device, sample_address = np.uint32(hd.device), sample.ctypes.data
    call_void(functions[_BEGIN], (device,))
    call_void(functions[_GET_DOUBLES], (_POSITION, sample_address))
    call_void(functions[_GET_DOUBLES], (_TRANSFORM, sample_address + 8 * SAMPLE_TRANSFORM))
    call_void(functions[_GET_DOUBLES], (_VELOCITY, sample_address + 8 * SAMPLE_VELOCITY))
    call_void(functions[_GET_INTEGERS], (_BUTTONS, numbers.ctypes.data + 8 * N_PRESSED))
    sample[SAMPLE_BUTTONS] = int32_at(numbers.ctypes.data + 8 * N_PRESSED)
    sample[SAMPLE_CLOCK] = seconds(functions[_CLOCK])
    # While a command is being written, the previous one stays in use, until it is older than `COMMAND_TIMEOUT`.
    read_whole(hd.command.changes, hd.command.shared, hd.command.whole, command)
    enable = command[COMMAND_ENABLE] > 0.0
    alive = enable and sample[SAMPLE_CLOCK] - command[COMMAND_CLOCK] <= COMMAND_TIMEOUT
    for i in range(3):
        hd.force[i] = command[i] if alive else 0.0
    if enable != (numbers[N_ENABLED] != 0):
        call_void(functions[_ENABLE] if enable else functions[_DISABLE], (_FORCE_OUTPUT,))
        numbers[N_ENABLED] = 1 if enable else 0
    call_void(functions[_SET_DOUBLES], (_CURRENT_FORCE, hd.force.ctypes.data))
    call_void(functions[_END], (device,))
    code = _take_errors(functions[_GET_ERROR])
    if code != 0:
        _report_error(hd, code)
    sample[SAMPLE_NUMBER] += 1.0
    write_whole(hd.sample.changes, hd.sample.shared, sample)
    return _CONTINUE


def frame_for_c() -> int:
    """Address of `serve_frame` as a C function, an HDSchedulerCallback."""
    return address_for_c(serve_frame, types.uint32(types.intp))


@entry_point
def take_sample(hd: HdMemory) -> None:
    """Convert the newest sample into a reading, if there is a new one and the library raised no error."""
    io, numbers, sample, reading = hd.io, hd.numbers, hd.sample.read, hd.reading
    io[IO_NEW] = io[IO_CODE] = io[IO_FAULT] = 0.0
    last = reading[READING_SEQUENCE]
    read_whole(hd.sample.changes, hd.sample.shared, hd.sample.whole, sample)
    barrier()
    if numbers[N_ERRORS_RAISED] != numbers[N_ERRORS_TAKEN]:
        barrier()
        io[IO_CODE], io[IO_VALUE] = hd.error[ERROR_CODE], hd.error[ERROR_VALUE]
        barrier()
        numbers[N_ERRORS_TAKEN] += 1
        return
    if sample[SAMPLE_NUMBER] == last:  # no new sample, or one that is half written
        return
    io[IO_NEW], reading[READING_SEQUENCE] = 1.0, sample[SAMPLE_NUMBER]
    # x_P → −y_H, y_P → z_H, z_P → −x_H, of rows and of columns.
    for i in range(3):
        for j in range(3):
            same_sign = (i == 2) == (j == 2)
            entry = sample[SAMPLE_TRANSFORM + 4 * ((j + 2) % 3) + (i + 2) % 3]
            hd.frame[i, j] = entry if same_sign else -entry
    p_P = 1e-3 * sample[SAMPLE_POSITION], 1e-3 * sample[SAMPLE_POSITION + 1], 1e-3 * sample[SAMPLE_POSITION + 2]
    io[IO_FAULT], io[IO_VALUE] = place_stylus(reading, p_P, hd.frame)
    reading[READING_SWITCH] = float(int(sample[SAMPLE_BUTTONS]) & 1)
    reading[READING_CLOCK] = sample[SAMPLE_CLOCK]
    hd.telemetry[READ] = sample[SAMPLE_NUMBER]


@entry_point
def send_force(hd: HdMemory) -> None:
    """Command the tip force equivalent to the torques; zero if the motors are off or a torque is not finite."""
    io, command, torque = hd.io, hd.command.written, hd.torque
    io[IO_VALUE] = first_not_finite(torque)
    io[IO_FAULT] = 0.0 if io[IO_VALUE] == 0.0 else _FORCE_NOT_FINITE
    enable = io[IO_ENABLE] > 0.0 and io[IO_FAULT] == 0.0
    force = 0.0, 0.0, 0.0
    if enable:
        reading = hd.reading
        theta = (reading[READING_THETA], reading[READING_THETA + 1], reading[READING_THETA + 2])
        force = tip_force(theta, (torque[0], torque[1], torque[2]), hd.largest)
    for i in range(3):
        command[i] = force[i]
    command[COMMAND_ENABLE], command[COMMAND_CLOCK] = 1.0 if enable else 0.0, seconds(hd.functions[_CLOCK])
    write_whole(hd.command.changes, hd.command.shared, command)
