r"""The digital twin: a MuJoCo Phantom that tracks the device, and an estimate of the hand's force on the stylus.

The twin's state is predicted by one period of the model under the commanded torques and the hand's last estimated
torques; the encoders then correct it, as in a Luenberger observer with a double pole z₀ = e^(−ω T):

.. math:: \hat\theta = \theta^- + (1 - z_0^2)\,e, \quad \hat\omega = \omega^- + (1 - z_0)^2 e/T,
          \quad e = \theta - \theta^-

The hand's torques τ_h are estimated by a generalised-momentum observer (De Luca & Mattone, ICRA 2005; De Luca et al.,
IROS 2006): with p = (M(θ) + I) θ̇, I the added inertia (`sim.world.linkage`), and :math:`\dot p = \tau + C^T\dot\theta
- N - D\dot\theta - f + \tau_h`, f = f_c tanh(θ̇/ε),

.. math:: r = K \left(p(t) - p(0) - \int (\tau + C^T\dot\theta - N - D\dot\theta - f + r)\,dt\right),
          \qquad \dot r = K (\tau_h - r)

which needs no acceleration and is the hand's torque filtered by a first-order low-pass of rate K. The force is
F = J⁻ᵀ r. It includes all model errors, above all of friction: at rest up to the Coulomb friction, 0.04 N at the tip.
Friction and inertia are the published ones, or those of the device's file.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.arrays import Array, IntArray
from models.humanoid.skeleton import rest_pose
from models.phantom.dynamics import coriolis_matrix, gravity_torques, mass_matrix
from models.phantom.kinematics import force_from_torques, forward_kinematics, linkage_angles, vector_to_hand_frame
from models.phantom.spec import LINKAGE_JOINTS, MOTORS
from models.world.scene import PHANTOM, SceneConfig
from sim.compilation.compiled import entry_point
from sim.world.linkage import Linkage
from sim.world.plant import Plant, make_plant, step
from sim.world.world import World

BANDWIDTH = 2.0 * math.pi * 30.0
"""ω of the observer [rad/s]: above a hand's motion, below the noise of the encoders' differences."""
RESIDUAL_GAIN = 2.0 * math.pi * 10.0
"""K of the momentum observer [1/s]."""
FRICTION_TRANSITION_RATE = 0.05
"""ε, joint rate below which the direction of friction is uncertain [rad/s]."""
TWIN_CHANNELS: dict[str, tuple[int, ...]] = {"predicted": (3,), "apart": (), "hand_force": (3,)}
"""Tip position predicted for the tick, in H [m], its distance from the measured one [m], and the hand's force in H
[N]."""

_LEAST_GAIN = 5e-5  # [m/rad] below it the hand's force cannot be determined and is zero: 50 µm from the turret's axis
_INTEGRAL, _STARTED = 3, 6  # places in the memory of `momentum_residual`, which begins with r


@njit
def momentum_residual(
    memory: Array, theta: tuple[float, float, float], rate: tuple[float, float, float], torque: Array,
    joints: Array, period: float, gain: float,
) -> None:  # fmt: skip
    """Advance the residual r by one period (backward Euler in r).

    Parameters
    ----------
    memory : Array
        [r (3), the integral plus p(0) (3), started], updated.
    theta, rate : three floats each
        Joint angles [rad] and rates [rad/s].
    torque : Array
        Torques during the previous period [N m], shape (3,).
    joints : Array
        Coulomb friction [N m], viscous friction [N m s/rad] and added inertia [kg m²] of the joints, shape (3, 3).
    period, gain : float
        T [s], K [1/s].
    """
    m, c, n = mass_matrix(theta), coriolis_matrix(theta, rate), gravity_torques(theta)
    for i in range(3):
        momentum = m[i][0] * rate[0] + m[i][1] * rate[1] + m[i][2] * rate[2] + joints[2, i] * rate[i]
        if memory[_STARTED] == 0.0:
            memory[_INTEGRAL + i] = momentum
            continue
        coriolis = c[0][i] * rate[0] + c[1][i] * rate[1] + c[2][i] * rate[2]
        friction = joints[0, i] * np.tanh(rate[i] / FRICTION_TRANSITION_RATE) + joints[1, i] * rate[i]
        memory[_INTEGRAL + i] += period * (torque[i] + coriolis - n[i] - friction)
        memory[i] = gain * (momentum - memory[_INTEGRAL + i]) / (1.0 + gain * period)
        memory[_INTEGRAL + i] += period * memory[i]
    memory[_STARTED] = 1.0


class TwinMemory(NamedTuple):
    """State of the twin for compiled code.

    Attributes
    ----------
    plant : Plant
        The twin's world.
    qvel : Array
        View of its velocities.
    places, rates : IntArray
        Indices of θ1, θ2, θ3 and the two loop-closing joints in positions and velocities, shape (5,).
    motors : tuple of three ints
        Indices of the motors in its controls.
    of_angle, of_rate : float
        Observer gains on angle [1] and rate [1/s].
    theta, rate, torque : Array
        Joint angles [rad], rates [rad/s], and the torques since the last tick [N m], shape (3,).
    joints : Array
        Friction and added inertia of the joints, as in `momentum_residual`, shape (3, 3).
    residual : Array
        Memory of `momentum_residual`, shape (7,).
    last : Array
        Number of the last tick, shape (1,).
    """

    plant: Plant
    qvel: Array
    places: IntArray
    rates: IntArray
    motors: tuple[int, int, int]
    of_angle: float
    of_rate: float
    theta: Array
    rate: Array
    torque: Array
    joints: Array
    residual: Array
    last: Array


@njit
def _predict(twin: TwinMemory, predicted: Array) -> None:
    """Advance the model by a period; writes the joint angles to `predicted` (3,), and the rates to the twin's state."""
    w, plant = twin.rate, twin.plant
    angles, speeds = linkage_angles(twin.theta), linkage_angles(w)
    for i in range(5):
        plant.qpos[twin.places[i]], twin.qvel[twin.rates[i]] = angles[i], speeds[i]
    for i in range(3):
        plant.ctrl[twin.motors[i]] = twin.torque[i]
        plant.applied[plant.arm_v[i]] = twin.residual[i]
    step(plant)
    for i in range(3):
        predicted[i], w[i] = plant.qpos[twin.places[i]], twin.qvel[twin.rates[i]]


@entry_point
def follow_rows(
    twin: TwinMemory, numbers: Array, theta: Array, torque: Array, predicted: Array, apart: Array, force: Array
) -> None:
    """Advance the twin by n ticks; writes `predicted` (n, 3), `apart` (n,) and `force` (n, 3) (`TWIN_CHANNELS`)."""
    prediction = np.zeros(3)
    for k in range(len(numbers)):
        if numbers[k] == twin.last[0] + 1.0:
            _predict(twin, prediction)
        else:
            prediction[:] = theta[k]
            twin.rate[:] = 0.0
            twin.residual[:] = 0.0
        for i in range(3):
            error = theta[k, i] - prediction[i]
            twin.theta[i] = prediction[i] + twin.of_angle * error
            twin.rate[i] += twin.of_rate * error
        q = (twin.theta[0], twin.theta[1], twin.theta[2])
        w = (twin.rate[0], twin.rate[1], twin.rate[2])
        momentum_residual(twin.residual, q, w, twin.torque, twin.joints, twin.plant.period, RESIDUAL_GAIN)
        a = vector_to_hand_frame(forward_kinematics((prediction[0], prediction[1], prediction[2])))
        b = vector_to_hand_frame(forward_kinematics((theta[k, 0], theta[k, 1], theta[k, 2])))
        apart[k] = math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
        predicted[k, 0], predicted[k, 1], predicted[k, 2] = a
        hand = force_from_torques(q, (twin.residual[0], twin.residual[1], twin.residual[2]), _LEAST_GAIN)
        force[k, 0], force[k, 1], force[k, 2] = vector_to_hand_frame(hand)
        twin.torque[:] = torque[k]
        twin.last[0] = numbers[k]


class Twin:
    """A simulated Phantom that runs in parallel with a device.

    Parameters
    ----------
    scene : SceneConfig
        Parameters of its world; the servo period must be the device's.
    linkage : Linkage
        Friction and added inertia of the device.
    """

    def __init__(self, scene: SceneConfig, linkage: Linkage):
        self._world = World(scene, "none")
        linkage.into(self._world)
        self._world.reset(np.zeros(3), rest_pose())
        model, data = self._world.model, self._world.data
        joints = [model.joint(PHANTOM + name) for name in LINKAGE_JOINTS]
        a, b, c = (int(model.actuator(PHANTOM + name).id) for name in MOTORS)
        pole = math.exp(-BANDWIDTH * scene.servo_period)
        self._memory = TwinMemory(
            make_plant(self._world), data.qvel, np.array([int(joint.qposadr[0]) for joint in joints]),
            np.array([int(joint.dofadr[0]) for joint in joints]), (a, b, c), 1.0 - pole**2,
            (1.0 - pole) ** 2 / scene.servo_period, np.zeros(3), np.zeros(3), np.zeros(3),
            np.array([linkage.coulomb, linkage.viscous, linkage.inertia]), np.zeros(7), np.array([-2.0]),
        )  # fmt: skip

    def follow(self, rows: Mapping[str, Array]) -> dict[str, Array]:
        """Advance the twin by consecutive ticks; where ticks are missing it is re-initialised.

        Parameters
        ----------
        rows : mapping
            Channels tick, theta and torque of `sim.hardware.gated_servo.columns`.

        Returns
        -------
        dict
            Arrays by `TWIN_CHANNELS`.
        """
        n = len(rows["tick"])
        found = {name: np.zeros((n, *shape)) for name, shape in TWIN_CHANNELS.items()}
        numbers, theta, torque = (np.ascontiguousarray(rows[name]) for name in ("tick", "theta", "torque"))
        follow_rows(self._memory, numbers, theta, torque, found["predicted"], found["apart"], found["hand_force"])
        return found
