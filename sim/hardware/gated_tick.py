"""The compiled step between the loop's tick and the motors of a real device: gate, torques, thermal limit."""

import math
from typing import NamedTuple

import numpy as np

from controllers.safety.arming import motors_on
from controllers.safety.energy_tank import book_force
from controllers.safety.faults import FAULT_CODE, Fault, latch
from controllers.safety.gate import GATE_SHARE, GATE_STATE, Gate, pass_gate
from controllers.safety.limiter import LIMITER_FORCE, THERMAL_TIME
from controllers.safety.thermal import limit_by_heat
from controllers.state import HAND_TIME
from geometry.arrays import Array
from models.phantom.dynamics import gravity_torques
from models.phantom.parameters import PREMIUM_1_5
from sim.compilation.compiled import entry_point
from sim.devices.exchange import COMMAND_FAULT, COMMAND_FORCE, COMMAND_TORQUE, Exchange
from sim.world.encoders import ANGLES, PEAK_TORQUE, motor_torques

CONTINUOUS_TORQUE = PREMIUM_1_5.continuous_torque
MAX_HEAT_FRACTION = 0.98
"""Share of a motor's heat capacity above which a fault is latched."""

MOTORS_HOT = int(Fault.MOTORS_HOT)
MOTOR_HEAT, MOTORS_ON = 0, 1


class GateMemory(NamedTuple):
    """Parameters and state of a gate for the compiled tick.

    Attributes
    ----------
    params, shaking, gate, shaken : Array
        Arguments of `controllers.safety.gate.pass_gate`.
    heat : Array
        Thermal state of the motors (`controllers.safety.thermal`), shape (3,).
    motors : Array
        [largest share of a motor's heat capacity that is used, 1 while the motors are on], shape (2,).
    force, torque : Array
        Force that the gate lets through [N], and torques commanded to the motors [N m], shape (3,).
    cooling : float
        ``1 − exp(−T/τ)`` of the winding.
    own_weight : bool
        Whether the device compensates for its own weight (`sim.devices.driver.DeviceIdentity`).
    """

    params: Array
    shaking: Array
    gate: Array
    shaken: Array
    heat: Array
    motors: Array
    force: Array
    torque: Array
    cooling: float
    own_weight: bool

    @classmethod
    def of(cls, gate: Gate, own_weight: bool = False) -> "GateMemory":
        """Memory of a gate before its first tick, with cold motors."""
        return cls(
            gate.params(), gate.detector.params(), gate.fresh_memory(), gate.detector.fresh_memory(), np.zeros(3),
            np.zeros(2), np.zeros(3), np.zeros(3), 1.0 - math.exp(-gate.period / THERMAL_TIME), own_weight,
        )  # fmt: skip


@entry_point
def gated_tick(device: Exchange, gated: GateMemory, limiter: Array, tank: Array, asked: Array, request: int) -> None:
    """Compute the motor torques for the force that the loop commands; zero in every gate state without force.

    Limiter and tank are updated with the force that is actually exerted on the hand. Gravity compensation is ramped in
    together with the force. If the device compensates for its own weight, the Phantom's gravity torques are added only
    at the end, outside of all limits, because the driver subtracts them again.

    Parameters
    ----------
    device : Exchange
        Its `command` is overwritten.
    gated : GateMemory
        `force` and `torque` are written.
    limiter, tank : Array
        Memory of limiter and energy tank of the loop's field.
    asked : Array
        Force that the loop commands [N], in H, shape (3,).
    request : int
        Request to `controllers.safety.gate.pass_gate`.
    """
    force, torque, faults = gated.force, gated.torque, device.faults
    force[:] = asked
    pass_gate(gated.params, gated.shaking, gated.gate, gated.shaken, faults, device.hand, request, force)
    memory, withheld = device.memory, 1.0 if gated.own_weight else 1.0 - gated.gate[GATE_SHARE]
    motor_torques(faults, memory, device.hand[HAND_TIME], force, torque)
    # J(θ)ᵀF is already ramped in with F, the gravity torques are not yet.
    weight = gravity_torques((memory[ANGLES], memory[ANGLES + 1], memory[ANGLES + 2]))
    for i in range(3):
        torque[i] = min(PEAK_TORQUE[i], max(-PEAK_TORQUE[i], torque[i] - withheld * weight[i]))
    gated.motors[MOTOR_HEAT] = limit_by_heat(gated.heat, CONTINUOUS_TORQUE, PEAK_TORQUE, gated.cooling, torque)
    if gated.own_weight:
        for i in range(3):
            torque[i] += weight[i]
    if gated.motors[MOTOR_HEAT] > MAX_HEAT_FRACTION:
        latch(faults, MOTORS_HOT, device.hand[HAND_TIME], gated.motors[MOTOR_HEAT])
    on = motors_on(int(gated.gate[GATE_STATE]))
    gated.motors[MOTORS_ON] = 1.0 if on else 0.0
    if faults[FAULT_CODE] != 0.0 or not on:
        force[:] = 0.0
        torque[:] = 0.0
    book_force(tank, force)
    for i in range(3):
        limiter[LIMITER_FORCE + i] = force[i]
        device.command[COMMAND_TORQUE + i] = device.torque[i] = torque[i]
        device.command[COMMAND_FORCE + i] = force[i]
    device.command[COMMAND_FAULT] = faults[FAULT_CODE]
