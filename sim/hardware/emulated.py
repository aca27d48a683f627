"""An emulated device: the MuJoCo linkage behind a driver, with friction, added inertia, delay and encoder offsets.

Its clock advances by one servo period per command, so a run with it is reproducible. A simulated hand holds the stylus
in place, with a tremor, until the motors have been on for some time, and then lets go.
"""

import math

import numpy as np

from geometry.arrays import Array
from models.humanoid.skeleton import rest_pose
from models.phantom.kinematics import encoder_reading, forward_kinematics, gimbal_reading, vector_to_hand_frame
from models.world.scene import SceneConfig
from sim.compilation.compiled import entry_point
from sim.devices.driver import READ, DeviceIdentity, make_telemetry
from sim.devices.exchange import READING_CLOCK, READING_GIMBAL, READING_SEQUENCE, READING_SWITCH, READING_THETA
from sim.errors import SimError
from sim.users.hand.arm import Arm
from sim.users.hand.dragged import TREMOR_AMPLITUDE
from sim.world.linkage import Linkage
from sim.world.phantom_port import PhantomPort, phantom_port
from sim.world.plant import Hand, Plant, advance, make_hand, make_plant
from sim.world.world import World

TREMOR_FREQUENCY = 10.0
"""Frequency of the physiological tremor of a hand at rest [Hz]: the middle of 8 to 12."""


@entry_point
def step_physics(plant: Plant, port: PhantomPort, user: Hand, t: float, applied: Array) -> None:
    """Step the physics by the plant's period from time t [s] on; the caller has set the motor commands."""
    advance(plant, port, user, t, False, applied)


def tremor(seconds: float, period: float) -> Array:
    """Tremor displacement of a hand at rest [m], shape (n, 3), sampled every `period` [s]."""
    t = np.arange(0.0, seconds, period)
    return TREMOR_AMPLITUDE * np.sin(2.0 * np.pi * TREMOR_FREQUENCY * t[:, None] + np.array([0.0, 2.1, 4.2]))


def emulated_identity(transport: str, calibrated: bool) -> DeviceIdentity:
    """Identity of an emulated device that is reached by a given transport."""
    return DeviceIdentity("emulated Phantom", transport, "", "", forces=True, watchdog=True, calibrated=calibrated)


def delay_in_steps(scene: SceneConfig, delay: float) -> float:
    """Number of physics steps from the start of a period until a torque that is delayed by `delay` [s] acts.

    Raises
    ------
    SimError
        If the delay is longer than a servo period.
    """
    if delay > scene.servo_period:
        raise SimError(
            f"a delay of {delay:g} s; expected at most {scene.servo_period:g} s of an emulated device, the servo period"
        )
    # Semi-implicit integration moves positions half a step earlier than continuous time, hence the 0.5.
    return delay / scene.servo_period * scene.substeps() + 0.5


class EmulatedPhantom:
    """Driver of a linkage simulated in MuJoCo, switch pressed; every command advances it by one servo period.

    Parameters
    ----------
    scene : SceneConfig
        Gives servo period and physics step.
    start : Array
        Initial position of the stylus in H [m], shape (3,).
    linkage : Linkage, optional
        Parameters of the linkage; within the physics step in which a delayed torque begins, old and new torque are
        averaged by their shares of the step.
    arm : Arm, optional
        The user once the holding hand has let go; relaxed by default.
    holds : float
        Time for which the hand still holds the stylus after the motors were switched on [s].

    Raises
    ------
    SimError
        If the start is out of reach, or the delay too long (`delay_in_steps`).
    """

    def __init__(
        self, scene: SceneConfig, start: Array, linkage: Linkage | None = None, arm: Arm | None = None,
        holds: float = 1.5,
    ):  # fmt: skip
        linkage = linkage or Linkage()
        self.world = World(scene, "none")
        self.world.reset(start, rest_pose())
        linkage.into(self.world)
        self.port = phantom_port(self.world.model, self.world.data, scene.servo_period, 150.0)
        self._plant, self._offset = make_plant(self.world), np.array(linkage.offset)
        steps, delay_steps = self._plant.substeps, delay_in_steps(scene, linkage.delay)
        self._acts_next_period = delay_steps > steps  # the torque begins to act only in the next period
        delay_steps -= steps * self._acts_next_period
        whole_steps, fraction = int(delay_steps), delay_steps % 1.0
        spans = (whole_steps, 0.0), (1 if fraction > 0.0 else 0, 1.0 - fraction), (steps - math.ceil(delay_steps), 1.0)
        self._spans = [(n, new) for n, new in spans if n > 0]
        self._tremor = tremor(600.0, 2e-3)
        self._holding_hand = make_hand(Arm(path=start + self._tremor, period=2e-3)) if holds > 0.0 else None
        self._free_hand, self._hold_time, self._on_time = make_hand(arm or Arm()), holds, 0.0
        self._applied, self._motor_indices = np.zeros((steps, 3)), list(self.port.motor)
        self._last_torque, self._torque_before_last = np.zeros(3), np.zeros(3)
        self._command_count, self._sequence = 0, 0
        self.torque = np.zeros(3)
        self.telemetry = make_telemetry()
        self.identity = emulated_identity("MuJoCo", not any(linkage.offset))

    @property
    def clock(self) -> float:
        """The device's own time [s]."""
        return self._command_count * self._plant.period

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver`; there is a new reading after each command."""
        q, port, is_new = self.port.qpos, self.port, self._command_count + 1 > self._sequence
        theta = q[list(port.arm_q)] + self._offset
        reading[READING_THETA : READING_THETA + 3] = encoder_reading((theta[0], theta[1], theta[2]))
        g = port.gimbal_q
        reading[READING_GIMBAL : READING_GIMBAL + 3] = gimbal_reading((q[g[0]], q[g[1]], q[g[2]]))
        reading[READING_SWITCH], reading[READING_CLOCK] = 1.0, self.clock
        reading[READING_SEQUENCE] = self._sequence = self._command_count + 1
        self.telemetry[READ] += is_new
        return is_new

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver`; advances the device by a servo period."""
        self.torque[:] = torque if enable else 0.0
        if self._on_time > 0.0 and not enable:
            self._take_hold()
        self._on_time = self._on_time + self._plant.period if enable else 0.0
        user = self._free_hand if self._holding_hand is None or self._on_time > self._hold_time else self._holding_hand
        t, (new_torque, old_torque) = self.clock, (self.torque, self._last_torque)
        if self._acts_next_period:
            new_torque, old_torque = self._last_torque, self._torque_before_last
        for steps, new in self._spans:
            span = steps / self._plant.substeps * self._plant.period
            plant = self._plant._replace(substeps=steps, period=span)
            self.world.data.ctrl[self._motor_indices] = new * new_torque + (1.0 - new) * old_torque
            step_physics(plant, self.port, user, t, self._applied[:steps])
            t += span
        self._torque_before_last[:], self._last_torque[:] = self._last_torque, self.torque
        self._command_count += 1

    def _take_hold(self) -> None:
        """Let the hand hold the stylus at its present position, so that it does not fall."""
        if self._holding_hand is not None:
            a, b, c = (float(self.port.qpos[place]) for place in self.port.arm_q)
            self._holding_hand.arm.path[:] = vector_to_hand_frame(forward_kinematics((a, b, c))) + self._tremor

    def let_go(self) -> None:
        """See `sim.devices.driver.Driver`; no time passes."""
        self.torque[:] = self._last_torque[:] = self._torque_before_last[:] = 0.0

    def close(self) -> None:
        """See `sim.devices.driver.Driver`."""
        self.let_go()
