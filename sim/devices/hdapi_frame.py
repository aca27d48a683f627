"""A frame of HDAPI, compiled: what the vendor's scheduler calls in its own thread, and what the servo shares with it.

The thread of the scheduler runs no Python, so it never waits for the GIL, and takes nothing from the heap. Samples and
commands pass behind sequence locks (`sim.compilation.sequence_lock`), an error by two counts: neither side waits for
the other.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from numba import njit, types

from controllers.safety.faults import Fault, first_not_finite
from controllers.state import Array, IntArray
from sim.compilation.c_function import address_for_c, call_struct_head, call_void
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import int32_at, loader
from sim.compilation.python_clock import seconds
from sim.compilation.sequence_lock import barrier, read_whole, write_whole
from sim.devices.driver import READ
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA
from sim.devices.virtual_arm import place_stylus, tip_force

SILENCE = 5e-3
"""Time without a command after which the callback commands no force [s]; five of its periods."""
MOST_ERRORS = 32
"""That the library is asked for after a frame; those that it still keeps then are told after the next one."""

_DONE, _CONTINUE = np.uint32(0), np.uint32(1)
_BUTTONS, _POSITION, _VELOCITY, _TRANSFORM = np.uint32(0x2000), np.uint32(0x2050), np.uint32(0x2051), np.uint32(0x2052)
_MOTOR_TEMPERATURE, _CURRENT_FORCE, _FORCE_OUTPUT = np.uint32(0x2605), np.uint32(0x2700), np.uint32(0x4000)
_WARM_MOTORS, _EXCEEDED_VELOCITY = 0x0200, 0x0203
_FORCE_NOT_FINITE = int(Fault.FORCE_NOT_FINITE)

FUNCTIONS = (
    "hdBeginFrame", "hdEndFrame", "hdGetDoublev", "hdGetIntegerv", "hdSetDoublev", "hdEnable", "hdDisable",
    "hdGetError",
)  # fmt: skip
"""Of the library, in the order of their addresses; that of the clock is last."""
_BEGIN, _END, _GET_DOUBLES, _GET_INTEGERS, _SET_DOUBLES, _ENABLE, _DISABLE, _GET_ERROR, _CLOCK = range(9)

N_CLOSING, N_PRESSED, N_ENABLED, N_RAISED, N_HEARD, N_SIZE = range(6)
"""1 from when the callback is to end; the buttons, as an int; whether the motors are on; errors that the callback has
raised, and those that the servo has heard of."""
ERROR_CODE, ERROR_VALUE, ERROR_SIZE = range(3)
"""An error's number, and what was seen: a temperature [share of the highest], a speed [m/s], or the number."""
SAMPLE_POSITION, SAMPLE_TRANSFORM, SAMPLE_VELOCITY, SAMPLE_BUTTONS, SAMPLE_CLOCK, SAMPLE_NUMBER = 0, 3, 19, 22, 23, 24
SAMPLE_SIZE = 25
"""What a frame reads: tip [mm], the stylus's frame column by column (OpenGL), velocity [mm/s], buttons; the clock [s],
and the frame's number, from 1 on."""
COMMAND_ENABLE, COMMAND_CLOCK, COMMAND_SIZE = 3, 4, 5
"""After the force in P [N]: 1 where the motors are to be on, and when that was commanded [s]."""
TOLD_NEW, TOLD_CODE, TOLD_FAULT, TOLD_VALUE, TOLD_ENABLE, TOLD_SIZE = range(6)
"""1 where there is a new sample; the library's error, or what is wrong with pose or torque, with its value; 1 to
switch the motors on."""


class Locked(NamedTuple):
    """Numbers behind a sequence lock.

    Attributes
    ----------
    changes, shared : array
        Count and numbers of `sim.compilation.sequence_lock`.
    written, whole, read : Array
        The writer's own, and the reader's.
    """

    changes: IntArray
    shared: Array
    written: Array
    whole: Array
    read: Array

    @classmethod
    def fresh(cls, size: int) -> "Locked":
        """Zeros."""
        return cls(np.zeros(1, np.int64), *(np.zeros(size) for _ in range(4)))


class HdMemory(NamedTuple):
    """A device as its driver and the vendor's thread share it.

    Attributes
    ----------
    functions : IntArray
        Addresses, see `FUNCTIONS`.
    device : int
        The library's handle.
    largest : float
        The device's nominal force [N].
    numbers : IntArray
        See `N_CLOSING`.
    sample, command : Locked
        See `SAMPLE_POSITION`, `COMMAND_ENABLE`. The callback writes samples, the servo commands.
    force, heat : Array
        The callback's: the force that it sends [N], and the motors' temperatures, shapes (3,) and (6,).
    error : Array
        See `ERROR_CODE`: the servo's while it has not heard of it, else the callback's.
    frame, reading, torque, told, telemetry : Array
        The servo's: the stylus's orientation in H (3, 3), the last reading that can be, the torques to be commanded
        [N m], see `TOLD_NEW`, and the driver's telemetry.
    """

    functions: IntArray
    device: int
    largest: float
    numbers: IntArray
    sample: Locked
    command: Locked
    force: Array
    heat: Array
    error: Array
    frame: Array
    reading: Array
    torque: Array
    told: Array
    telemetry: Array

    @classmethod
    def fresh(cls, functions: list[int], device: int, largest: float, telemetry: Array) -> "HdMemory":
        """Memory of a device with its motors off, of which no sample has come."""
        return cls(
            np.array(functions, np.int64), device, largest, np.zeros(N_SIZE, np.int64), Locked.fresh(SAMPLE_SIZE),
            Locked.fresh(COMMAND_SIZE), np.zeros(3), np.zeros(6), np.zeros(ERROR_SIZE), np.zeros((3, 3)),
            np.zeros(READING_SIZE), np.zeros(3), np.zeros(TOLD_SIZE), telemetry,
        )  # fmt: skip


_memory_at: Any = loader(numba.typeof(HdMemory.fresh([], 0, 0.0, np.zeros(1))))


@njit
def _first_error(get_error: int) -> int:
    """The first of the errors that the library has kept, which are taken; 0 if there is none."""
    first = 0
    for _ in range(MOST_ERRORS):
        code = call_struct_head(get_error)
        if code == 0:
            break
        if first == 0:
            first = code
    return first


@njit
def _raise_error(hd: HdMemory, code: int) -> None:
    """Leave an error for the servo, unless it has not heard of the last one yet."""
    numbers, error, sample = hd.numbers, hd.error, hd.sample.written
    if numbers[N_RAISED] != numbers[N_HEARD]:
        return
    error[ERROR_CODE] = error[ERROR_VALUE] = code
    if code == _WARM_MOTORS:
        call_void(hd.functions[_GET_DOUBLES], (_MOTOR_TEMPERATURE, hd.heat.ctypes.data))
        error[ERROR_VALUE] = hd.heat.max()
    elif code == _EXCEEDED_VELOCITY:
        x, y, z = sample[SAMPLE_VELOCITY], sample[SAMPLE_VELOCITY + 1], sample[SAMPLE_VELOCITY + 2]
        error[ERROR_VALUE] = np.sqrt(x * x + y * y + z * z) * 1e-3
    barrier()
    numbers[N_RAISED] += 1


@entry_point
def serve_frame(memory: int) -> np.uint32:
    """What the vendor's scheduler calls, with the address of an `HdMemory`: state in, force out."""
    hd = _memory_at(memory)
    call, numbers, sample, command = hd.functions, hd.numbers, hd.sample.written, hd.command.read
    if numbers[N_CLOSING] != 0:
        return _DONE
    device, place = np.uint32(hd.device), sample.ctypes.data
    call_void(call[_BEGIN], (device,))
    call_void(call[_GET_DOUBLES], (_POSITION, place))
    call_void(call[_GET_DOUBLES], (_TRANSFORM, place + 8 * SAMPLE_TRANSFORM))
    call_void(call[_GET_DOUBLES], (_VELOCITY, place + 8 * SAMPLE_VELOCITY))
    call_void(call[_GET_INTEGERS], (_BUTTONS, numbers.ctypes.data + 8 * N_PRESSED))
    sample[SAMPLE_BUTTONS] = int32_at(numbers.ctypes.data + 8 * N_PRESSED)
    sample[SAMPLE_CLOCK] = seconds(call[_CLOCK])
    # A command that is being written is heard in the next frame: until then the last one, while it is young enough.
    read_whole(hd.command.changes, hd.command.shared, hd.command.whole, command)
    enable = command[COMMAND_ENABLE] > 0.0
    alive = enable and sample[SAMPLE_CLOCK] - command[COMMAND_CLOCK] <= SILENCE
    for i in range(3):
        hd.force[i] = command[i] if alive else 0.0
    if enable != (numbers[N_ENABLED] != 0):
        call_void(call[_ENABLE] if enable else call[_DISABLE], (_FORCE_OUTPUT,))
        numbers[N_ENABLED] = 1 if enable else 0
    call_void(call[_SET_DOUBLES], (_CURRENT_FORCE, hd.force.ctypes.data))
    call_void(call[_END], (device,))
    code = _first_error(call[_GET_ERROR])
    if code != 0:
        _raise_error(hd, code)
    sample[SAMPLE_NUMBER] += 1.0
    write_whole(hd.sample.changes, hd.sample.shared, sample)
    return _CONTINUE


def frame_for_c() -> int:
    """Address of `serve_frame`, an HDSchedulerCallback."""
    return address_for_c(serve_frame, types.uint32(types.intp))


@entry_point
def take_sample(hd: HdMemory) -> None:
    """Make a reading of the newest sample, if there is a new one and no error of the library."""
    told, numbers, sample, reading = hd.told, hd.numbers, hd.sample.read, hd.reading
    told[TOLD_NEW] = told[TOLD_CODE] = told[TOLD_FAULT] = 0.0
    last = reading[READING_SEQUENCE]
    read_whole(hd.sample.changes, hd.sample.shared, hd.sample.whole, sample)
    barrier()
    if numbers[N_RAISED] != numbers[N_HEARD]:
        barrier()
        told[TOLD_CODE], told[TOLD_VALUE] = hd.error[ERROR_CODE], hd.error[ERROR_VALUE]
        barrier()
        numbers[N_HEARD] += 1
        return
    if sample[SAMPLE_NUMBER] == last:  # as of one that is half written
        return
    told[TOLD_NEW], reading[READING_SEQUENCE] = 1.0, sample[SAMPLE_NUMBER]
    # x_P → −y_H, y_P → z_H, z_P → −x_H, of rows and of columns.
    for i in range(3):
        for j in range(3):
            same = (i == 2) == (j == 2)
            entry = sample[SAMPLE_TRANSFORM + 4 * ((j + 2) % 3) + (i + 2) % 3]
            hd.frame[i, j] = entry if same else -entry
    p_P = 1e-3 * sample[SAMPLE_POSITION], 1e-3 * sample[SAMPLE_POSITION + 1], 1e-3 * sample[SAMPLE_POSITION + 2]
    told[TOLD_FAULT], told[TOLD_VALUE] = place_stylus(reading, p_P, hd.frame)
    reading[READING_SWITCH] = float(int(sample[SAMPLE_BUTTONS]) & 1)
    reading[READING_CLOCK] = sample[SAMPLE_CLOCK]
    hd.telemetry[READ] = sample[SAMPLE_NUMBER]


@entry_point
def send_force(hd: HdMemory) -> None:
    """Command the force that the torques stand for; none where the motors are off, or a torque is not finite."""
    told, command, torque = hd.told, hd.command.written, hd.torque
    told[TOLD_VALUE] = first_not_finite(torque)
    told[TOLD_FAULT] = 0.0 if told[TOLD_VALUE] == 0.0 else _FORCE_NOT_FINITE
    enable = told[TOLD_ENABLE] > 0.0 and told[TOLD_FAULT] == 0.0
    force = 0.0, 0.0, 0.0
    if enable:
        reading = hd.reading
        theta = (reading[READING_THETA], reading[READING_THETA + 1], reading[READING_THETA + 2])
        force = tip_force(theta, (torque[0], torque[1], torque[2]), hd.largest)
    for i in range(3):
        command[i] = force[i]
    command[COMMAND_ENABLE], command[COMMAND_CLOCK] = 1.0 if enable else 0.0, seconds(hd.functions[_CLOCK])
    write_whole(hd.command.changes, hd.command.shared, command)
