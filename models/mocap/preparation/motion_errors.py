r"""Errors of a motion that contact forces and joint torques alone cannot produce, with their derivatives.

They are, at sampled instants,

- the residual wrench at the centre of mass, r = w − A f*, with f* the contact forces that best produce the required
  wrench w (`floor_forces`; variable projection, Golub & Pereyra 1973), weighted more in flight, where f* = 0;
- the displacement of standing contact spheres from their places (foot skate), with a weight that fades out beside the
  stance, and of sliding ones from where they were captured, and the depth of the others below the floor;
- the excess over joint limits (its cost is linear) and joint torques beyond three quarters of their limits;
- how much deeper limbs are in each other or in the trunk than in the capture.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry import quaternions
from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS, N_TANGENT, joint_range, torque_limit
from models.mocap.dynamics.floor_forces import ALL_CONTACTS, EDGES, Floor, RequiredWrench
from models.mocap.motion.interpenetration import PARTS, overlaps
from models.mocap.motion.ranges import vectors_in_ranges
from models.mocap.preparation.change import Change
from models.mocap.preparation.stances import Stances, clearance
from models.mocap.preparation.wrench_derivatives import WrenchDerivatives

JOINT_LIMIT_MARGIN = 0.02  # distance kept from the joints' limits [rad]
_STRAIN_THRESHOLD = 0.75  # fraction of the torque limits beyond which torque is penalised
# Excess [rad] over a joint's range from which its cost is linear, an exact penalty (Nocedal & Wright 2006, ch. 17).
# If it is squared throughout, a captured ankle 100° beyond its range outweighs all other errors, and spinkick has a
# residual of 3.5 % of body weight instead of 2.3 %. With 0.1 the figure falls in snu/backflip; with 0.03 a wrist in a
# later capture exceeds its range by 67° for a moment.
_LINEAR_EXCESS = 0.05
_ALL = slice(None)
TORQUE_COUNT = 3 * len(JOINTS)
DYNAMIC_COUNT = TORQUE_COUNT + 6  # number of the first errors, torques and wrench, that depend on velocities


@dataclass(frozen=True)
class FeasibleWeights:
    """Weights of the errors before squaring, per sampled instant.

    Those of height, leg, ankle, jerk and strain were chosen on captures of the tuning half, the others on three walks
    and a run of it (`docs/validation/preparation-choices.md#the-feasible-motion`).

    Parameters
    ----------
    force, moment : float
        Residual force, per body weight; residual moment, per body weight × metre.
    flight : float
        Factor on both while no sphere bears load.
    slip, depth : float
        Displacement of a standing sphere, depth of a swinging sphere below its clearance [1/m].
    overlap : float
        Depth of a limb in another or in the trunk beyond the capture's [1/m].
    limit : float
        Excess of a rotation vector over its limits [1/rad].
    strain : float
        Excess of a joint torque over three quarters of its limit, as a fraction of the limit.
    place, height, root, spine, head, arm, leg, ankle : float
        Change of the root's position over the floor and of its height [1/m], and of rotations [1/rad].
    sway, jerk : float
        Third derivative of the change of the root's position [s³/m] and of rotations [s³/rad].
    """

    force: float = 20.0
    moment: float = 40.0
    flight: float = 5.0
    slip: float = 300.0
    depth: float = 600.0
    overlap: float = 100.0
    limit: float = 100.0
    strain: float = 20.0
    place: float = 1.0
    height: float = 30.0
    root: float = 8.0
    spine: float = 6.0
    head: float = 8.0
    arm: float = 4.0
    leg: float = 6.0
    ankle: float = 4.0
    sway: float = 3e-3
    jerk: float = 1.5e-4

    def tracking(self) -> Array:
        """Weights of the change, shape (57,)."""
        kinds = {"abdomen": self.spine, "chest": self.spine, "head": self.head}
        parts = {"hip": self.leg, "knee": self.leg, "ankle": self.ankle}
        joints = [kinds.get(joint) or parts.get(joint.split("_")[-1]) or self.arm for joint in JOINTS]
        return np.concatenate(((self.place, self.place, self.height), np.repeat([self.root, *joints], 3)))


class Errors(NamedTuple):
    """Errors of m instants.

    Attributes
    ----------
    weighted : array, shape (m, 108 + 4k), or (m, 113 + 4k) if limbs are kept apart
        Weighted errors of the nonlinear terms.
    jacobian : array or None
        Blocks of their Jacobian.
    residual : array, shape (m, 6)
        Residual wrench [N], [N m].
    grip : array, shape (m, 4k)
        Contact forces along the edges of the friction pyramids [N].
    torque_ratio : array, shape (m, 51)
        Joint torques as fractions of their limits.
    """

    weighted: Array
    jacobian: Array | None
    residual: Array
    grip: Array
    torque_ratio: Array


class _LimitErrors(NamedTuple):
    """Weighted errors of joints beyond their ranges, (m, 51), and their derivatives by each rotation, (m, 17, 3, 3)."""

    weighted: Array
    rates: Array


class MotionErrors:
    """Errors of a changed clip by which it differs from a feasible motion.

    Parameters
    ----------
    change : Change
        Change of the clip.
    schedule : Stances
        Its contact schedule, frame by frame.
    overlap : array, shape (5,), or None
        How deep each of `interpenetration.PARTS` may be in each other [m]; None if limbs are not kept apart.
    """

    def __init__(self, change: Change, schedule: Stances, overlap: Array | None = None) -> None:
        self.change, self.w, self.overlap = change, FeasibleWeights(), overlap
        self.contacts = ALL_CONTACTS[: schedule.standing.shape[1]]
        self.floor = Floor(self.w.moment / self.w.force, self.contacts)
        frames = np.minimum(np.round(change.times * change.clip.fps).astype(int), len(schedule.standing) - 1)
        self.pushing, self.places = schedule.pushing[frames], schedule.places[frames]
        self.grounded = (schedule.standing | schedule.sliding)[frames]
        self.pinned = np.repeat(schedule.kept[frames][:, :, None], 3, axis=2)
        self.pinned[:, :, 2] = self.grounded
        self.clearance = clearance(schedule, change.clip.fps, change.closed)[frames]
        self.low, self.high = joint_range()[..., 0] + JOINT_LIMIT_MARGIN, joint_range()[..., 1] - JOINT_LIMIT_MARGIN

    def at(self, x: Array, with_jacobian: bool, instants: npt.NDArray[np.intp] | slice = _ALL) -> Errors:
        """Errors of the changed clip: torques (51), wrench (6), slip (3k), depth (k), limits (51), overlaps (5)."""
        w, k = self.w, len(self.contacts)
        state = self.change.states(x.reshape(-1, N_TANGENT), instants)
        m = len(state.q)
        pushing, grounded, pinned = self.pushing[instants], self.grounded[instants], self.pinned[instants]
        demand = self.floor.demand(state.q, state.v, state.a)
        grip = self.floor.grip(demand, pushing)
        residual = demand.wrench - np.einsum("mij,mj->mi", demand.columns(), grip)
        weight = self.floor.body_weight
        scale = np.where(pushing.any(axis=1), 1.0, w.flight)[:, None] / weight
        scale = scale * np.repeat([w.force, w.moment], 3)
        slip = w.slip * pinned * (demand.spheres - self.places[instants])
        depth = (
            w.depth * np.minimum(demand.spheres[:, :, 2] - CONTACT_RADIUS - self.clearance[instants], 0.0) * ~grounded
        )
        limits = self._limit_errors(state.q)
        torque_ratio = demand.torque_on(grip) / torque_limit()
        strain = torque_ratio - np.clip(torque_ratio, -_STRAIN_THRESHOLD, _STRAIN_THRESHOLD)
        parts = [w.strain * strain, scale * residual, slip.reshape(m, 3 * k), depth, limits.weighted]
        overlap = None
        if self.overlap is not None:
            overlap = overlaps(state.q, self.overlap)
            parts.append(w.overlap * np.maximum(overlap.depths - self.overlap, 0.0))
        weighted = np.concatenate(parts, axis=1)
        if not with_jacobian:
            return Errors(weighted, None, residual, grip, torque_ratio)
        jacobian = np.zeros((m, 3, weighted.shape[1], N_TANGENT))
        derivatives = WrenchDerivatives(state, demand, self.floor.segments)
        self._differentiate_forces(jacobian, demand, derivatives, grip, scale, strain)
        slips, depths = slice(DYNAMIC_COUNT, DYNAMIC_COUNT + 3 * k), slice(DYNAMIC_COUNT + 3 * k, DYNAMIC_COUNT + 4 * k)
        jacobian[:, 0, slips] = (w.slip * pinned[..., None] * derivatives.spheres).reshape(m, 3 * k, N_TANGENT)
        jacobian[:, 0, depths] = w.depth * (depth < 0)[:, :, None] * derivatives.spheres[:, :, 2]
        for joint in range(len(JOINTS)):
            axes = slice(3 * joint, 3 * joint + 3)
            jacobian[:, 0, depths.stop :][:, axes, 6:][:, :, axes] = limits.rates[:, joint]
        if overlap is not None:
            jacobian[:, 0, -len(PARTS) :] = w.overlap * overlap.gradients
        return Errors(weighted, jacobian, residual, grip, torque_ratio)

    def _limit_errors(self, q: Array) -> _LimitErrors:
        """Errors of joints beyond their ranges, in poses (m, 75)."""
        vectors = vectors_in_ranges(q[:, 7:].reshape(len(q), -1, 4), self.low, self.high)
        excess = vectors - np.clip(vectors, self.low, self.high)
        magnitude = np.maximum(np.abs(excess), _LINEAR_EXCESS)
        # The penalty's square is 2 e |excess| - e² beyond e = _LINEAR_EXCESS.
        penalty_root = np.sqrt(2.0 * _LINEAR_EXCESS * magnitude - _LINEAR_EXCESS**2)
        penalty = excess / magnitude * penalty_root
        slope = self.w.limit * _LINEAR_EXCESS / penalty_root * (excess != 0)
        rates = slope[..., None] * quaternions.logarithm_derivative(vectors)
        return _LimitErrors(self.w.limit * penalty.reshape(len(q), -1), rates)

    def _differentiate_forces(
        self,
        jacobian: Array,
        demand: RequiredWrench,
        derivatives: WrenchDerivatives,
        grip: Array,
        scale: Array,
        strain: Array,
    ) -> None:
        """Write the rows of torques and residual wrench; `Floor.answer` gives how contact forces follow the wrench."""
        wrench_rows = derivatives.wrench
        force_gain = self.floor.answer(demand, grip)
        projection = np.eye(6) - demand.columns() @ force_gain
        forces = grip.reshape(len(grip), -1, 4) @ EDGES
        arms = np.zeros((len(grip), 6, N_TANGENT))
        for sphere in range(len(self.contacts)):
            # Moments of the contact forces change with their lever arms.
            arms[:, 3:] -= quaternions.cross_matrix(forces[:, sphere]) @ (
                derivatives.spheres[:, sphere] - derivatives.com
            )
        wrench_rows[:, 0] -= arms
        jacobian[:, :, TORQUE_COUNT:DYNAMIC_COUNT] = scale[:, None, :, None] * np.einsum(
            "mij,mojn->moin", projection, wrench_rows
        )
        strained = np.flatnonzero(np.any(strain != 0, axis=1))
        if len(strained):
            gain = self.w.strain * (strain[strained] != 0) / torque_limit()
            force_response = demand.levers()[strained] @ force_gain[strained]
            torque = derivatives.torque[strained] - np.einsum("mti,moin->motn", force_response, wrench_rows[strained])
            torque[:, 0] -= derivatives.torque_by_contact_force(forces, strained)
            jacobian[strained, :, :TORQUE_COUNT] = gain[:, None, :, None] * torque
