r"""Faults of a device and its controller: plausibility checks of readings, and latching of faults.

A fault is **latched**: from the tick of its detection on, the motors are off until `rearm` is called. Its code, time
and value stay in the device's `faults`, an array that the device's kernels, the loop and the device driver read; it is
recorded at every tick.

| fault | evidence |
|---|---|
| not finite | a reading, the field's force, or the memory of limiter or tank is NaN or infinite |
| rate impossible | :math:`|\theta_k - \theta_{k-1}| > \omega_{max}\,\Delta t + 2\,\delta`, δ a count of the encoder |
| stale | a device that numbers its readings has sent no new one for longer than the silence |
| frozen | no encoder counted for longer than `still`, under a torque over `still_load` times a joint's friction |
| clock back | a reading with a later number has an earlier time |
| ended | a replayed hand has no more rows |

A **gap** is not a fault: if two readings are further apart than the silence, the servo did not run in between. The
device has then switched its force off by itself (`is_silent`); the gap is counted, and the force is ramped in again.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from geometry.arrays import Array


class Fault(IntEnum):
    """Reason why a device switched its force off; `words` describes it."""

    NONE = 0
    FORCE_NOT_FINITE = 1
    LIMITER_NOT_FINITE = 2
    TANK_NOT_FINITE = 3
    READING_NOT_FINITE = 4
    RATE_IMPOSSIBLE = 5
    READING_STALE = 6
    ENCODERS_FROZEN = 7
    READINGS_ENDED = 8
    UNPLUGGED = 9
    CHECKSUM_WRONG = 10
    SEQUENCE_BACK = 11
    OVER_TEMPERATURE = 12
    DEVICE_RESET = 13
    VERSION_WRONG = 14
    REPORT_MALFORMED = 15
    DEVICE_REPORTED = 16
    OSCILLATION = 17
    LEFT_WORKSPACE = 18
    TOO_FAST = 19
    MOTORS_HOT = 20
    SERVO_LATE = 21
    CONTROL_LOST = 22
    MOTORS_OFF = 23
    CLOCK_BACK = 24

    def words(self, value: float) -> str:
        """Description of the fault, with its value."""
        return _DESCRIPTIONS[self].format(value)


_DESCRIPTIONS = {
    Fault.NONE: "no fault",
    Fault.FORCE_NOT_FINITE: "the field requested a force or moment of {:g}",
    Fault.LIMITER_NOT_FINITE: "the limiter's memory held {:g}",
    Fault.TANK_NOT_FINITE: "the energy tank's memory held {:g}",
    Fault.READING_NOT_FINITE: "the device read {:g}",
    Fault.RATE_IMPOSSIBLE: "a joint speed of {:.4g} rad/s was read, which is impossible",
    Fault.READING_STALE: "the device gave no new reading for {:.3g} s",
    Fault.ENCODERS_FROZEN: "no encoder counted for {:.3g} s under a torque that moves the stylus",
    Fault.READINGS_ENDED: "the replayed hand had ended after {:.0f} ticks",
    Fault.UNPLUGGED: "the device was disconnected",
    Fault.CHECKSUM_WRONG: "{:.0f} reports in a row had a wrong checksum",
    Fault.SEQUENCE_BACK: "a reading came {:.0f} numbers behind the last one",
    Fault.OVER_TEMPERATURE: "a motor is at {:.0f} °C",
    Fault.DEVICE_RESET: "the device restarted by itself",
    Fault.VERSION_WRONG: "the device speaks major version {:.0f} of the protocol",
    Fault.REPORT_MALFORMED: "a report of {:.0f} bytes",
    Fault.DEVICE_REPORTED: "the device reported error {:.0f}",
    Fault.OSCILLATION: "the force oscillated by {:.3g} N at the frequency of an instability",
    Fault.LEFT_WORKSPACE: "the stylus was {:.3g} m outside the workspace",
    Fault.TOO_FAST: "the stylus moved at {:.3g} m/s",
    Fault.MOTORS_HOT: "the motors have used {:.0%} of what they can dissipate",
    Fault.SERVO_LATE: "the servo was {:.3g} s late",
    Fault.CONTROL_LOST: "the process that controls the run has not answered for {:.3g} s",
    Fault.MOTORS_OFF: "the device left its motors off for {:.3g} s after the command to switch them on",
    Fault.CLOCK_BACK: "the device's clock went back by {:.3g} s",
}

# Plain integers: numba freezes globals, but would look up a member of an enumeration in each kernel.
FORCE_NOT_FINITE, LIMITER_NOT_FINITE = int(Fault.FORCE_NOT_FINITE), int(Fault.LIMITER_NOT_FINITE)
TANK_NOT_FINITE, READING_NOT_FINITE = int(Fault.TANK_NOT_FINITE), int(Fault.READING_NOT_FINITE)
RATE_IMPOSSIBLE, READING_STALE = int(Fault.RATE_IMPOSSIBLE), int(Fault.READING_STALE)
ENCODERS_FROZEN, READINGS_ENDED = int(Fault.ENCODERS_FROZEN), int(Fault.READINGS_ENDED)
CLOCK_BACK = int(Fault.CLOCK_BACK)

# Layout of a device's `faults`: public values, internal state, limits.
FAULT_CODE, FAULT_TIME, FAULT_VALUE, FAULT_GAPS, FAULT_LAST_GAP, FAULT_RAMP = range(6)
_STARTED, _LAST_CLOCK, _ELAPSED, _SEQUENCE, _FRESH_TIME, _STILL_SINCE, _LOAD, _COMMAND_TIME = range(6, 14)
_PERIOD, _MAX_RATE, _COUNT, _SILENCE, _RAMP_TIME, _STILL_TIME, _STILL_LOAD, FAULT_SIZE = 14, 15, 18, 21, 22, 23, 24, 25

NO_SEQUENCE = -1.0
"""Sequence number of readings of a device that does not number them."""
HELD, TAKEN, RESTARTED = 0, 1, 2
"""What to do with a reading: keep the last one, use it, or use it and reset the velocity estimate."""

_LATE_PERIODS = 1.5  # [periods] between two readings, from which their true time difference is used for the speed


@njit
def latch(faults: Array, code: int, t: float, value: float) -> None:
    """Latch a fault at time t [s]; the first one is kept."""
    if faults[FAULT_CODE] == 0.0:
        faults[FAULT_CODE], faults[FAULT_TIME], faults[FAULT_VALUE] = code, t, value


@njit
def first_not_finite(values: Array | tuple[float, ...]) -> float:
    """The first of the values that is NaN or infinite; 0 if there is none."""
    for value in values:
        if not np.isfinite(value):
            return value
    return 0.0


@njit
def _is_repeated(faults: Array, t: float, sequence: float) -> bool:
    """Whether a numbered reading is the last one again; if so for longer than the silence, a fault is latched."""
    if sequence != faults[_SEQUENCE]:
        faults[_SEQUENCE], faults[_FRESH_TIME] = sequence, t
        return False
    if np.isnan(faults[_FRESH_TIME]):
        faults[_FRESH_TIME] = t
    if faults[_STARTED] == 0.0:
        faults[FAULT_RAMP] = 0.0
    # With a tolerance of half a period, since sums of periods are rounded.
    if t - faults[_FRESH_TIME] > faults[_SILENCE] - 0.5 * faults[_PERIOD]:
        latch(faults, READING_STALE, t, t - faults[_FRESH_TIME])
    return True


@njit
def judge_reading(
    faults: Array,
    theta: tuple[float, float, float],
    gimbal: tuple[float, float, float],
    last: Array,
    t: float,
    clock: float,
    sequence: float,
    held: bool,
) -> int:
    """Check the joint angles of a reading for plausibility, and latch faults.

    Parameters
    ----------
    faults : Array
        Faults of the device; updated.
    theta, gimbal : three floats each
        Joint angles as read [rad]. The gimbal has no motors and may swing freely, so it only has to be finite.
    last : Array
        Angles of the last reading that was used [rad], shape (3,) or longer.
    t : float
        Time of the tick [s], for the latch.
    clock : float
        Time of the reading by the device's own clock [s].
    sequence : float
        Sequence number of the reading, or `NO_SEQUENCE`.
    held : bool
        Whether a simulated hand may hold the stylus still without an encoder count; a real hand trembles.

    Returns
    -------
    int
        `HELD`, `TAKEN` or `RESTARTED`; `elapsed` gives the time that the reading spans.
    """
    if sequence >= 0.0 and _is_repeated(faults, t, sequence):
        return HELD
    value = first_not_finite((theta[0], theta[1], theta[2], gimbal[0], gimbal[1], gimbal[2], clock))
    if value != 0.0:
        latch(faults, READING_NOT_FINITE, t, value)
        return HELD
    period = faults[_PERIOD]
    started = faults[_STARTED] != 0.0
    elapsed = clock - faults[_LAST_CLOCK] if started else period
    if sequence >= 0.0 and elapsed < 0.0:  # a simulated device may restart from its beginning
        latch(faults, CLOCK_BACK, t, -elapsed)
    faults[_STARTED], faults[_LAST_CLOCK] = 1.0, clock
    faults[_ELAPSED] = elapsed if elapsed > _LATE_PERIODS * period else period
    verdict = TAKEN
    if elapsed > faults[_SILENCE]:
        faults[FAULT_GAPS] += 1.0
        faults[FAULT_LAST_GAP], faults[FAULT_RAMP] = elapsed, 0.0
        verdict = RESTARTED
    moved = not started or verdict == RESTARTED
    for i in range(3):
        turn = abs(theta[i] - last[i])
        moved = moved or turn > 0.0
        if started and turn > faults[_MAX_RATE + i] * faults[_ELAPSED] + 2.0 * faults[_COUNT + i]:
            latch(faults, RATE_IMPOSSIBLE, t, turn / faults[_ELAPSED])
            verdict = RESTARTED
    if moved or held or faults[_LOAD] <= faults[_STILL_LOAD]:
        faults[_STILL_SINCE] = clock
    elif clock - faults[_STILL_SINCE] > faults[_STILL_TIME]:
        latch(faults, ENCODERS_FROZEN, t, clock - faults[_STILL_SINCE])
    return verdict


@njit
def ramp_in(faults: Array, force: Array) -> None:
    """Scale a force (3,) in place by the ramped-in fraction, then raise this fraction by one period's increment."""
    if faults[FAULT_RAMP] < 1.0:
        for i in range(3):
            force[i] *= faults[FAULT_RAMP]
        faults[FAULT_RAMP] = min(1.0, faults[FAULT_RAMP] + faults[_PERIOD] / faults[_RAMP_TIME])


@njit
def elapsed(faults: Array) -> float:
    """Time that the last reading's change of angle spans [s]: the period, unless readings were missed."""
    return faults[_ELAPSED]


@njit
def note_command(faults: Array, t: float, load: float) -> None:
    """Store the time t [s] of a command and its `load`, the largest ratio of joint torque to Coulomb friction."""
    faults[_COMMAND_TIME], faults[_LOAD] = t, load


@njit
def is_silent(faults: Array, t: float) -> bool:
    """Watchdog: whether at time t [s] there is a fault or the last command is older than the silence; no force then."""
    return faults[FAULT_CODE] != 0.0 or t - faults[_COMMAND_TIME] > faults[_SILENCE]


def rearm(faults: Array) -> None:
    """Clear a latched fault: the force is ramped in from zero, from the next reading on. The count of gaps is kept."""
    faults[FAULT_CODE] = faults[FAULT_TIME] = faults[FAULT_VALUE] = faults[FAULT_RAMP] = 0.0
    faults[_STARTED] = faults[_LOAD] = 0.0
    faults[_FRESH_TIME] = faults[_COMMAND_TIME] = np.nan


@dataclass(frozen=True)
class Plausibility:
    r"""Limits of plausible readings of a device, and times of its watchdog and ramp.

    Parameters
    ----------
    period : float
        Servo period T [s].
    rates : three floats
        ω_max, largest possible speed of each joint [rad/s].
    steps : three floats
        δ, one count of each encoder [rad].
    silence : float
        Time without a reading or a command after which a device switches its force off [s]; at least two periods.
    ramp : float
        Time in which the force is ramped in after a gap or a fault [s]; of the order of a reaction time, so that a hand
        can respond.
    still, still_load : float
        Longest time without an encoder count [s] while a joint's torque exceeds `still_load` times its Coulomb
        friction. A free stylus would move: at four times the friction, with the Premium's 0.04 N and 75 g at the tip,
        by one count (0.03 mm) in 6 ms. A held stylus trembles with the hand, at 8 to 12 Hz and by several counts: at
        least four periods in half a second. At smaller torques a hand may rest without any count.

    Raises
    ------
    ParameterError
        If a value is not positive, or the silence is shorter than two periods.
    """

    period: float
    rates: tuple[float, float, float]
    steps: tuple[float, float, float]
    silence: float
    ramp: float = 0.25
    still: float = 0.5
    still_load: float = 4.0

    def __post_init__(self) -> None:
        for name in ("period", "silence", "ramp", "still", "still_load"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"{name} of a device's readings must be positive, got {getattr(self, name)}")
        if not (min(self.rates) > 0.0 and min(self.steps) > 0.0):
            raise ParameterError(f"rates {self.rates} and steps {self.steps} of a device's joints must be positive")
        if self.silence < 2.0 * self.period:
            raise ParameterError(f"a silence of {self.silence} s is shorter than two periods of {self.period} s")

    def fresh(self, ramp: float = 1.0) -> Array:
        """`faults` of a device before its first reading, without a fault; `ramp` is its initial force fraction."""
        faults = np.zeros(FAULT_SIZE)
        faults[FAULT_RAMP] = ramp
        faults[_FRESH_TIME] = faults[_COMMAND_TIME] = np.nan
        faults[_PERIOD], faults[_MAX_RATE:_COUNT], faults[_COUNT:_SILENCE] = self.period, self.rates, self.steps
        faults[_SILENCE], faults[_RAMP_TIME] = self.silence, self.ramp
        faults[_STILL_TIME], faults[_STILL_LOAD] = self.still, self.still_load
        return faults


@dataclass(frozen=True)
class LatchedFault:
    """A latched fault, its time [s] and its value."""

    fault: Fault
    t: float
    value: float

    def line(self) -> str:
        """The fault as a sentence."""
        return f"The motors were switched off at {self.t:.3f} s: {self.fault.words(self.value)}."


def latched(faults: Array) -> LatchedFault | None:
    """The fault latched in a device's `faults`, or None."""
    code = Fault(int(faults[FAULT_CODE]))
    if code is Fault.NONE:
        return None
    return LatchedFault(code, float(faults[FAULT_TIME]), float(faults[FAULT_VALUE]))
