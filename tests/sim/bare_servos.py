"""Servos of a device and a FOLLOW field without clips, which compile quickly."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Program
from controllers.fields.follow import Follow
from controllers.safety.energy_tank import EnergyTank
from controllers.safety.limiter import ForceLimiter
from controllers.state import HandState
from models.humanoid.skeleton import rest_pose
from models.phantom.kinematics import encoder_reading, gimbal_reading
from models.world.scene import SceneConfig
from sim.body.drive import no_figure
from sim.compilation.compiled import entry_point
from sim.devices.device import DeviceState, actuate, read_device, user_torques
from sim.devices.device import advance as advance_device
from sim.devices.exchange import (
    READING_CLOCK,
    READING_GIMBAL,
    READING_SEQUENCE,
    READING_SWITCH,
    READING_THETA,
    Exchange,
    valid_torque,
)
from sim.devices.simulated import SimulatedPhantom, simulated_phantom
from sim.loop.channels import make_logs
from sim.loop.servo import FrameLog, Servo, TickLog, run_block, unlinked_field
from sim.reference.reference import no_reference
from sim.users.hand.arm import Arm
from sim.world.phantom_port import PhantomPort, phantom_port
from sim.world.plant import Hand, Plant, advance, make_plant
from sim.world.world import World

START = np.array([0.02, 0.01, 0.0])
CUTOFF = 150.0
FIGURE_TICKS = 2


def follow_program(stiffness: float = 300.0, damping: float = 4.0) -> Program:
    return Follow(Trajectory.circle(0.05, 4.0), k_r=stiffness, b_d=damping).program()


def device_world(scene: SceneConfig | None = None, start: np.ndarray = START) -> World:
    world = World(scene or SceneConfig(), "none")
    world.reset(start, rest_pose())
    return world


def bare_servo(world: World, device: DeviceState, program: Program | None = None, limiter: ForceLimiter | None = None,
               tank: EnergyTank | None = None) -> Servo:  # fmt: skip
    program = program or follow_program()
    period = world.config.servo_period
    limiter, tank = limiter or ForceLimiter(period), tank or EnergyTank(period, power=0.2, capacity=0.5)
    field = unlinked_field(program, limiter, tank)
    servo = Servo(make_plant(world), device, field, no_reference(), no_figure(), FIGURE_TICKS, device.hand[1:8])
    return servo.linked(program)


def simulated(world: World, arm: Arm | None = None) -> SimulatedPhantom:
    port = phantom_port(world.model, world.data, world.config.servo_period, CUTOFF)
    return simulated_phantom(port, arm or Arm())


def run(servo: Servo, n: int, first: int = 0) -> tuple[TickLog, FrameLog]:
    ticks, frames = make_logs(servo, n)
    run_block(servo, first, n, False, ticks, frames)
    return ticks, frames


@entry_point
def pass_period(plant: Plant, port: PhantomPort, user: Hand, t: float, applied: np.ndarray) -> None:
    """Advance a simulated Phantom, whose motors the caller has set, by a servo period."""
    advance(plant, port, user, t, False, applied)


@entry_point
def write_device(device: DeviceState, plant: Plant, t: float, force: np.ndarray, applied: np.ndarray) -> None:
    """Call `actuate` and `advance` from Python, without a servo; `applied` (substeps, columns) is written."""
    actuate(device, force)
    advance_device(device, plant, t, False, applied)


class SteppedPhantom:
    """A simulated Phantom stepped from Python: read, then write, once per period."""

    def __init__(self, world: World, arm: Arm | None = None, cutoff: float = CUTOFF):
        self.device = simulated_phantom(phantom_port(world.model, world.data, world.config.servo_period, cutoff),
                                        arm or Arm())  # fmt: skip
        self.plant, self.ticks = make_plant(world), 0
        self._applied = np.zeros((self.plant.substeps, user_torques(self.device)))

    def read(self) -> HandState:
        read_device(self.device, self.ticks * self.plant.period)
        return HandState.of(self.device.hand)

    def write(self, force: np.ndarray) -> None:
        write_device(self.device, self.plant, self.ticks * self.plant.period, force, self._applied)
        self.ticks += 1


class SimulatedDriver:
    """Driver of an `Exchange` with a second simulated Phantom as its hardware.

    Its clock runs whether the servo does or not, and its motors go off when a command gets too old.
    """

    def __init__(self, device: Exchange, arm: Arm | None = None, start: np.ndarray = START):
        self.device = device
        self.world = device_world(start=start)
        self.phantom = simulated(self.world, arm)
        self.plant = make_plant(self.world)
        self.ticks = 0
        self.torque = np.zeros(3)
        self._applied = np.zeros((self.plant.substeps, 3))

    @property
    def clock(self) -> float:
        return self.ticks * self.plant.period

    def read(self) -> None:
        """Write a new reading."""
        port, r = self.phantom.port, self.device.reading
        r[READING_THETA : READING_THETA + 3] = encoder_reading(tuple(port.qpos[list(port.arm_q)]))
        r[READING_GIMBAL : READING_GIMBAL + 3] = gimbal_reading(tuple(port.qpos[list(port.gimbal_q)]))
        r[READING_SWITCH], r[READING_CLOCK] = 0.0, self.clock
        r[READING_SEQUENCE] += 1.0

    def write(self) -> None:
        """Apply the command if it is still valid, and advance by a period."""
        valid_torque(self.device.command, self.device.silence, self.clock, self.torque)
        self.plant.ctrl[list(self.phantom.port.motor)] = self.torque
        pass_period(self.plant, self.phantom.port, self.phantom.user, self.clock, self._applied)
        self.ticks += 1
