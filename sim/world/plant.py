"""Stepping of the world from compiled code: the physics and the user's hand, one servo period at a time."""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.kernel_call import call_as_given
from controllers.lent import by_pointer
from controllers.safety.faults import is_silent
from geometry.arrays import Array
from models.phantom.spec import MOTOR_JOINTS
from models.world.scene import PHANTOM
from sim.compilation.native import mj_step
from sim.users.hand.arm import Arm, CompiledArm, hand_force
from sim.users.hand.fingers import turning_moment
from sim.users.person.person_state import PersonState, no_person
from sim.world.phantom_port import PhantomPort, let_go, true_motion, true_turn
from sim.world.world import World


class Plant(NamedTuple):
    """The world and its rates.

    Attributes
    ----------
    model, data : int
        Addresses of MjModel and MjData.
    qpos, ctrl, applied : Array
        Views of MuJoCo's own memory: state, motor commands, external generalised forces.
    ground : Array
        View of the total ground reaction force on the figure [N], shape (3,); zero for a world without one.
    arm_v : tuple of three ints
        Degrees of freedom of θ1, θ2, θ3.
    substeps : int
        Physics steps per servo period.
    period : float
        Servo period T [s].
    """

    model: int
    data: int
    qpos: Array
    ctrl: Array
    applied: Array
    ground: Array
    arm_v: tuple[int, int, int]
    substeps: int
    period: float


class Hand(NamedTuple):
    """The simulated user's hand on the stylus; all vectors are in H.

    `p`, `v`, `jacobian` and `force` are the stylus's true position, velocity and Jacobian, and the hand's force; `q`
    (wxyz), `w`, `axes` and `moment` are its true orientation, angular velocity and gimbal axes, and the hand's moment.
    A `person`, if there is one, sets the force in place of the `arm`.
    """

    arm: CompiledArm
    p: Array
    v: Array
    jacobian: Array
    force: Array
    q: Array
    w: Array
    axes: Array
    moment: Array
    person: PersonState


def make_plant(world: World) -> Plant:
    """Connect to a world; it must outlive the plant, which holds addresses of its memory."""
    model, data = world.model, world.data
    a, b, c = (int(model.joint(PHANTOM + name).dofadr[0]) for name in MOTOR_JOINTS)
    return Plant(
        model=model._address, data=data._address, qpos=data.qpos, ctrl=data.ctrl, applied=data.qfrc_applied,
        ground=world.ground, arm_v=(a, b, c), substeps=world.config.substeps(), period=world.config.servo_period,
    )  # fmt: skip


def make_hand(user: Arm | PersonState) -> Hand:
    """A simulated user before its first tick."""
    linear = np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros(3)
    arm, person = (user, no_person()) if isinstance(user, Arm) else (Arm(), user)
    return Hand(arm.compiled(), *linear, np.zeros(4), np.zeros(3), np.zeros((3, 3)), np.zeros(3), person)


@njit
def advance(plant: Plant, port: PhantomPort, hand: Hand, t: float, replay: bool, applied: Array) -> None:
    """Step the physics from time t for one servo period.

    Motors are switched off if their last command is too old, as by a real device's watchdog.

    Parameters
    ----------
    plant, port, hand
        Updated.
    t : float
        [s]
    replay : bool
        Take the hand's torques from `applied` instead of computing them.
    applied : Array
        The hand's torques about θ1, θ2, θ3 at each physics step, τ = JᵀF [N m], and with six columns about the gimbal
        joints, τ = AᵀM; written or read, shape (substeps, 3 or 6).
    """
    turning = applied.shape[1] > 3
    if not replay and is_silent(port.faults, t):
        let_go(port)
    for i in range(plant.substeps):
        if not replay:
            true_motion(port, hand.p, hand.v, hand.jacobian)
            if hand.person.units[0] != 0:
                when, dt = t + i * plant.period / plant.substeps, plant.period / plant.substeps
                call_as_given(
                    hand.person.units[0],
                    (by_pointer(hand.person), when, dt, i, hand.p, hand.v, hand.force, hand.arm.switch),
                )
            else:
                hand_force(hand.arm, t + i * plant.period / plant.substeps, hand.p, hand.v, hand.force)
            J, F = hand.jacobian, hand.force
            for j in range(3):
                applied[i, j] = J[0, j] * F[0] + J[1, j] * F[1] + J[2, j] * F[2]
            if turning:
                arm, A, M = hand.arm, hand.axes, hand.moment
                true_turn(port, hand.q, hand.w, A)
                when = t + i * plant.period / plant.substeps
                turning_moment(arm.turn_stiffness, arm.turn_damping, arm.turns, when, hand.q, hand.w, M)
                for j in range(3):
                    applied[i, 3 + j] = A[0, j] * M[0] + A[1, j] * M[1] + A[2, j] * M[2]
        for j in range(3):
            plant.applied[plant.arm_v[j]] = applied[i, j]
            if turning:
                plant.applied[port.gimbal_v[j]] = applied[i, 3 + j]
        mj_step(plant.model, plant.data)


@njit
def step(plant: Plant) -> None:
    """Step the physics for one servo period, without a simulated hand."""
    for _ in range(plant.substeps):
        mj_step(plant.model, plant.data)
