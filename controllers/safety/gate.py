r"""Safety gate, the last stage before the motors of a real device: limits the commanded force and decides when it acts.

.. math:: F = g\, s\, w(p)\, u(v)\, \min(1, L/|F_w|)\, F_w, \qquad |F_k - F_{k-1}| \le r\,T

g is the gain of the oscillation detector, s the ramped-in fraction (0 in every state but `RAMPING` and `ACTIVE`);
w and u fall from 1 to 0 between a limit of workspace or speed and the end of the margin beyond it, where a fault is
latched. The gate does not rely on earlier stages: for any input its output is finite, within L and the slew rate r.
Switching off is exempt from the slew rate.

Its requirements are those of existing haptic devices: no force until the commanded force has been small (CHAI3D);
limits of force, force rate, speed and temperature (OpenHaptics' HDAPI, with their errors); brakes above a speed, and a
watchdog (Force Dimension's DHD); reflexes that stop and stay stopped (Franka).
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from controllers.checks import check_positive
from controllers.errors import ParameterError
from controllers.safety import arming
from controllers.safety.arming import motors_on, next_state
from controllers.safety.faults import FAULT_CODE, FORCE_NOT_FINITE, Fault, latch
from controllers.safety.limiter import magnitude
from controllers.safety.oscillation import OSCILLATION_GAIN, OscillationDetector, oscillation_gain
from controllers.state import HAND_POSITION, HAND_SWITCH, HAND_TIME, HAND_VELOCITY
from geometry.arrays import Array
from geometry.vectors import Vector

_PERIOD, _MAX_FORCE, _MAX_CHANGE, _MAX_SPEED, _SPEED_MARGIN, _MARGIN, _SMALL_FORCE, _QUIET_TIME, _RAMP_TIME = range(9)
_DEAD_MAN, _PERMITTED, _LOW_CORNER, _HIGH_CORNER, _SIZE = 9, 10, 11, 14, 17
GATE_STATE, GATE_SHARE, GATE_QUIET, GATE_GAIN, GATE_FORCE, GATE_SIZE = 0, 1, 2, 3, 4, 7

OSCILLATION, LEFT_WORKSPACE, TOO_FAST = int(Fault.OSCILLATION), int(Fault.LEFT_WORKSPACE), int(Fault.TOO_FAST)


@njit
def pass_gate(
    params: Array, shaking: Array, gate: Array, shaken: Array, faults: Array, hand: Array, request: int, force: Array
) -> None:
    """Update the state of the gate at this tick, and limit the force.

    Parameters
    ----------
    params, shaking : Array
        `Gate.params`, and those of its `OscillationDetector`.
    gate, shaken : Array
        Memory [state, share, quiet time [s], gain, last force (3)], and that of the detector; written.
    faults : Array
        Faults of the device; detected faults are latched.
    hand : Array
        The hand vector as measured.
    request : int
        `ARM`, `DISARM`, `CLEAR` or `NO_REQUEST`; before `CLEAR` the caller must have called `rearm`.
    force : Array
        Demanded force [N], shape (3,); replaced by the force that is let through.
    """
    t, period = hand[HAND_TIME], params[_PERIOD]
    if not np.isfinite(force[0] + force[1] + force[2]):
        latch(faults, FORCE_NOT_FINITE, t, force[0] + force[1] + force[2])
        force[0] = force[1] = force[2] = 0.0
    size = magnitude(force[0], force[1], force[2])
    held = params[_DEAD_MAN] == 0.0 or hand[HAND_SWITCH] > 0.0
    quiet = held and size <= params[_SMALL_FORCE]
    gate[GATE_QUIET] = gate[GATE_QUIET] + period if quiet else 0.0

    if request == arming.CLEAR and faults[FAULT_CODE] == 0.0:
        gate[GATE_STATE] = next_state(int(gate[GATE_STATE]), arming.CLEAR)
    state = _apply_requests(params, int(gate[GATE_STATE]), request, held, gate[GATE_QUIET])
    if motors_on(state):
        _check_motion(params, faults, hand)
        gain = oscillation_gain(shaking, shaken, force)
        if gain < 0.0:
            latch(faults, OSCILLATION, t, -gain)
    else:
        # Without force the loop is open and cannot oscillate: the detector is reset.
        gain = 1.0
        shaken[:] = 0.0
        shaken[OSCILLATION_GAIN] = 1.0
    if faults[FAULT_CODE] != 0.0:
        state = next_state(state, arming.FAULTED)
    share = min(1.0, gate[GATE_SHARE] + period / params[_RAMP_TIME]) if motors_on(state) else 0.0
    if state == arming.RAMPING and share >= 1.0:
        state = next_state(state, arming.RAMPED)
    gate[GATE_STATE], gate[GATE_SHARE], gate[GATE_GAIN] = state, share, max(0.0, gain)
    if motors_on(state):
        _limit_slew(
            params, gate, gain * share * _fade(params, hand) * min(1.0, params[_MAX_FORCE] / max(size, 1e-300)), force
        )
    else:
        for i in range(3):
            force[i] = gate[GATE_FORCE + i] = 0.0


@njit
def _apply_requests(params: Array, state: int, request: int, held: bool, quiet: float) -> int:
    """State after the user's request, the dead-man switch, and the time that the force has been small [s]."""
    if request == arming.DISARM or (request == arming.ARM and params[_PERMITTED] > 0.0):
        state = next_state(state, request)
    if not held:
        state = next_state(state, arming.RELEASED)
    if state == arming.ARMING and quiet >= params[_QUIET_TIME]:
        state = next_state(state, arming.QUIET)
    return state


@njit
def _check_motion(params: Array, faults: Array, hand: Array) -> None:
    """Latch a fault if the hand is beyond the margin of workspace or speed; the comparisons also catch NaN."""
    speed, outside = _speed(hand), _distance_outside(params, hand)
    if not outside <= params[_MARGIN]:
        latch(faults, LEFT_WORKSPACE, hand[HAND_TIME], outside)
    if not speed <= params[_MAX_SPEED] + params[_SPEED_MARGIN]:
        latch(faults, TOO_FAST, hand[HAND_TIME], speed)


@njit
def _speed(hand: Array) -> float:
    v = HAND_VELOCITY
    return np.sqrt(hand[v] ** 2 + hand[v + 1] ** 2 + hand[v + 2] ** 2)


@njit
def _distance_outside(params: Array, hand: Array) -> float:
    """Distance from the box of the workspace [m], 0 within it."""
    square = 0.0
    for i in range(3):
        p = hand[HAND_POSITION + i]
        square += np.maximum(0.0, np.maximum(params[_LOW_CORNER + i] - p, p - params[_HIGH_CORNER + i])) ** 2
    return np.sqrt(square)


@njit
def _fade(params: Array, hand: Array) -> float:
    """w(p) u(v): 1 within the limits, 0 at the end of the margins."""
    w = 1.0 - _distance_outside(params, hand) / params[_MARGIN]
    u = 1.0 - (_speed(hand) - params[_MAX_SPEED]) / params[_SPEED_MARGIN]
    return max(0.0, min(1.0, w)) * max(0.0, min(1.0, u))


@njit
def _limit_slew(params: Array, gate: Array, scale: float, force: Array) -> None:
    """Scale a force, limit its change from the last one to the slew rate, and store it."""
    change = 0.0
    for i in range(3):
        force[i] *= scale
        change += (force[i] - gate[GATE_FORCE + i]) ** 2
    share = min(1.0, params[_MAX_CHANGE] / max(np.sqrt(change), 1e-300))
    for i in range(3):
        force[i] = gate[GATE_FORCE + i] + (force[i] - gate[GATE_FORCE + i]) * share
        gate[GATE_FORCE + i] = force[i]


@dataclass(frozen=True)
class Gate:
    """Limits of the force on a real device.

    Parameters
    ----------
    period : float
        Servo period T [s].
    force : float
        L, largest force [N]; half of the Premium's peak.
    slew : float
        r, largest change of the force [N/s].
    speed, speed_margin : float
        Tip speed above which the force fades, and the range of speed above it over which it fades, until a fault [m/s].
    low, high : three floats
        Corners of the workspace box in H [m]; the Premium 1.5's is 191 × 381 × 267 mm (data sheet) about its centre.
    margin : float
        Distance over which the force fades outside the box, until a fault [m].
    small, quiet : float
        No force until the demanded force has been at most `small` [N] for `quiet` [s]. A river pulls with b_d |φ̇| even
        if the hand is on its curve: 0.6 N at 8 N s/m and 8 cm/s.
    ramp : float
        Time in which the force is ramped in [s].
    dead_man : bool
        Whether the stylus switch must be held for any force (dead-man switch).
    permitted : bool
        Whether the device may be armed at all: requires a certificate of this field and device, and a calibration.
    oscillation : OscillationDetector, optional
        By default a detector with the same period.

    Raises
    ------
    ParameterError
        If a number is not positive and finite, or the box has no room in it.
    """

    period: float
    force: float = 4.0
    slew: float = 1000.0
    speed: float = 1.0
    speed_margin: float = 0.5
    low: Vector = (-0.10, -0.20, -0.14)
    high: Vector = (0.10, 0.20, 0.14)
    margin: float = 0.02
    small: float = 1.0
    quiet: float = 0.05
    ramp: float = 1.0
    dead_man: bool = True
    permitted: bool = False
    oscillation: OscillationDetector | None = field(default=None)

    def __post_init__(self) -> None:
        positive = ("period", "force", "slew", "speed", "speed_margin", "margin", "small", "quiet", "ramp")
        check_positive("the gate", self, *positive)
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ParameterError(f"a workspace from {self.low} to {self.high} m has no room in it")

    @property
    def detector(self) -> OscillationDetector:
        """The oscillation detector."""
        return self.oscillation or OscillationDetector(self.period)

    def params(self) -> Array:
        """Parameters of `pass_gate`."""
        params = np.zeros(_SIZE)
        params[:_DEAD_MAN] = (
            self.period, self.force, self.slew * self.period, self.speed, self.speed_margin, self.margin, self.small,
            self.quiet, self.ramp,
        )  # fmt: skip
        params[_DEAD_MAN], params[_PERMITTED] = float(self.dead_man), float(self.permitted)
        params[_LOW_CORNER:_HIGH_CORNER], params[_HIGH_CORNER:_SIZE] = self.low, self.high
        return params

    def fresh_memory(self) -> Array:
        """Memory of a device that is disarmed."""
        memory = np.zeros(GATE_SIZE)
        memory[GATE_STATE], memory[GATE_GAIN] = arming.DISARMED, 1.0
        return memory
