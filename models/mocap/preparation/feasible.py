r"""The motion nearest a capture that floor contact alone can drive, by Gauss–Newton over the whole of it.

Minimises over the change δ(t) of `change` the sum over sampled instants of squared

- residual wrench at the centre of mass, r = w − A f*, f* the contact forces that answer w best (`floor_forces`;
  variable projection, Golub & Pereyra 1973), more in flight, where nothing can answer;
- displacement of standing spheres from their places, depth of the others below the floor;
- excess over joint limits, torques of the legs beyond three quarters of their strength;
- the change itself, and its third derivative.

Feet are planted together with the dynamics: planted by inverse kinematics alone, they made tracking worse.
"""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from models.humanoid.skeleton import (
    BODIES,
    CONTACT_RADIUS,
    FOOT_CONTACTS,
    JOINTS,
    N_TANGENT,
    figure_model,
    joint_range,
    torque_limit,
)
from models.mocap import quaternions
from models.mocap.clip import Clip
from models.mocap.dynamics.floor_forces import EDGES, Demand, Floor
from models.mocap.preparation.change import DEGREE, Change, Normal, State
from models.mocap.preparation.stances import Stances

Array = npt.NDArray[np.float64]

_MARGIN = 0.02  # to the joints' limits [rad]
_STRONG = 0.75  # share of the legs' largest torques beyond which effort counts
_KNOT, _STEP = 0.05, 0.0125  # of the change and of the instants [s]; 80 and 20 ms cost half, and a run falls
_SWING, _ROLL = 0.006, 0.0  # least heights of swinging feet and of the lifted end of a standing one [m] ...
_RISE = 0.08  # ... reached so long before and after they stand [s]; captured feet swing at 2 to 5 cm
_TOLERANCE = 0.003  # share of the cost by which the last iteration lowers it
_ANGLE, _RATE = 1e-5, 1e-4  # of the differences of inverse dynamics [rad], [rad/s]
_N, _W, _S, _D = np.cumsum((51, 6, 24, 8))  # ends of the blocks of errors: torques, wrench, slip, depth
_LEGS = tuple(BODIES.index(f"{side}_{part}") for side in ("left", "right") for part in ("thigh", "shank", "foot"))


@dataclass(frozen=True)
class FeasibleWeights:
    """What one unit of error costs before it is squared, per sampled instant.

    Chosen on three walks and a run of the tuning half (`docs/validation/prepared-captures.md`). The jerk's weight
    matters: with a smaller one two walks needed 21 and 9 % instead of 7 and 5, and with 5e-5 the run stood.

    Parameters
    ----------
    force, moment : float
        Residual force, per body weight; residual moment, per body weight × metre.
    flight : float
        Factor on both while nothing pushes.
    slip, depth : float
        Displacement of a standing sphere, depth of a swinging one [1/m].
    limit : float
        Excess of a rotation vector over its limits [1/rad].
    strain : float
        Torque of a leg's joint beyond three quarters of its largest, as a share of it.
    place, root, spine, head, arm, leg, ankle : float
        Change of the root's place [1/m], and of rotations [1/rad].
    sway, jerk : float
        Third derivatives of the change [s³/m], [s³/rad].
    """

    force: float = 20.0
    moment: float = 40.0
    flight: float = 5.0
    slip: float = 300.0
    depth: float = 600.0
    limit: float = 100.0
    strain: float = 10.0
    place: float = 1.0
    root: float = 8.0
    spine: float = 6.0
    head: float = 8.0
    arm: float = 4.0
    leg: float = 3.0
    ankle: float = 2.0
    sway: float = 3e-3
    jerk: float = 3e-4

    def tracking(self) -> Array:
        """Weights of the change, shape (57,)."""
        kinds = {"abdomen": self.spine, "chest": self.spine, "head": self.head}
        parts = {"hip": self.leg, "knee": self.leg, "ankle": self.ankle}
        joints = [kinds.get(joint) or parts.get(joint.split("_")[-1]) or self.arm for joint in JOINTS]
        return np.repeat([self.place, self.root, *joints], 3)


_WEIGHTS = FeasibleWeights()


class Feasible(NamedTuple):
    """A motion made feasible.

    Attributes
    ----------
    clip : Clip
        The motion.
    residual : float
        RMS of the residual force that is left, in body weights.
    moved : float
        RMS of the change of the root's place [m].
    turned : float
        RMS over joints and time of the change of rotations [rad].
    costs : tuple of float
        Before and after every iteration.
    """

    clip: Clip
    residual: float
    moved: float
    turned: float
    costs: tuple[float, ...]


class _Errors(NamedTuple):
    """Weighted errors (m, 140) of the nonlinear terms, their Jacobian blocks, and the residual wrench (m, 6)."""

    weighted: Array
    jacobian: Array | None
    residual: Array


def feasible(
    clip: Clip, schedule: Stances, iterations: int = 16, fps: float = 120.0, weights: FeasibleWeights = _WEIGHTS
) -> Feasible:
    """The nearest motion with these contacts that needs no help.

    Parameters
    ----------
    clip : Clip
        A capture without noise, closed or open.
    schedule : Stances
        Its contacts, frame by frame.
    iterations : int
        Of Gauss–Newton, at most.
    fps : float
        Frames per second of the result.
    weights : FeasibleWeights
        Of the errors.
    """
    change = Change(clip, _KNOT, _STEP)
    problem = _Problem(change, schedule, weights)
    x, costs = problem.solve(iterations)
    sizes = change.size(x.reshape(-1, N_TANGENT))
    errors = problem.errors(x, False)
    force = np.linalg.norm(errors.residual[:, :3], axis=1) / problem.floor.body_weight
    return Feasible(
        change.changed(x.reshape(-1, N_TANGENT), fps),
        float(np.sqrt(np.mean(force**2))),
        float(np.sqrt(np.mean(np.sum(sizes[:, :3] ** 2, axis=1)))),
        float(np.sqrt(np.mean(np.sum(sizes[:, 6:].reshape(len(sizes), -1, 3) ** 2, axis=2)))),
        tuple(costs),
    )


class _Problem:
    """The least-squares problem of one clip."""

    def __init__(self, change: Change, schedule: Stances, weights: FeasibleWeights) -> None:
        self.change, self.w = change, weights
        self.floor = Floor(weights.moment / weights.force)
        frames = np.minimum(np.round(change.times * change.clip.fps).astype(int), len(schedule.standing) - 1)
        self.standing, self.pushing = schedule.standing[frames], schedule.pushing[frames]
        self.places = schedule.places[frames]
        self.grounded = self.standing | schedule.sliding[frames]
        self.pinned = np.repeat(self.standing[:, :, None], 3, axis=2).astype(np.float64)
        self.pinned[:, :, 2] = self.grounded
        self.clearance = _clearance(schedule, change.clip.fps, change.closed)[frames]
        self.model = figure_model()
        self.data = mujoco.MjData(self.model)
        self.spheres = [int(self.model.geom(name).id) for name in FOOT_CONTACTS]
        self.low, self.high = joint_range().reshape(-1, 2).T + np.array([[_MARGIN], [-_MARGIN]])
        self.fixed = Normal(change)
        tracking = weights.tracking() ** 2
        calm = np.where(np.arange(N_TANGENT) < 3, weights.sway, weights.jerk) ** 2
        for interval in range(change.intervals):
            here = np.flatnonzero(change.first == interval)
            blocks = [np.einsum("ma,mb->ab", basis[here], basis[here]) for basis in (change.basis[0], change.basis[3])]
            self.fixed.add(interval, np.kron(blocks[0], np.diag(tracking)) + np.kron(blocks[1], np.diag(calm)))

    def cost(self, errors: _Errors, x: Array) -> float:
        return float(np.sum(errors.weighted**2) + x @ self.fixed.times(x))

    def solve(self, iterations: int) -> tuple[Array, list[float]]:
        """Levenberg–Marquardt from no change, until the cost falls by less than `_TOLERANCE`."""
        change = self.change
        x = np.zeros(change.n_points * N_TANGENT)
        damping = 1e-4
        errors = self.errors(x, True)
        costs = [self.cost(errors, x)]
        for _ in range(iterations):
            system, parts = self.fixed.copy(), np.zeros((change.intervals, (DEGREE + 1) * N_TANGENT))
            for interval in range(change.intervals):
                rows = self._rows(errors, np.flatnonzero(change.first == interval))
                if rows is not None:
                    system.add(interval, rows[0].T @ rows[0])
                    parts[interval] = rows[0].T @ rows[1]
            g = system.gradient(parts) + self.fixed.times(x)
            for _ in range(12):
                trial = x - system.solve(g, damping)
                after = self.errors(trial, False)
                if (cost := self.cost(after, trial)) < costs[-1]:
                    break
                damping = max(8.0 * damping, 1e-4)
            else:
                break
            x, damping = trial, max(damping / 8.0, 1e-8)
            costs.append(cost)
            if costs[-2] - cost < _TOLERANCE * cost:
                break
            errors = self.errors(x, True)
        return x, costs

    def _rows(self, errors: _Errors, here: npt.NDArray[np.intp]) -> tuple[Array, Array] | None:
        """Jacobian by the six control points of an interval and errors, stacked over its instants."""
        assert errors.jacobian is not None
        if not len(here):
            return None
        basis = [self.change.basis[order][here] for order in range(3)]
        jacobian = errors.jacobian[here]
        live = np.any(jacobian != 0, axis=(1, 3))
        stacked = np.concatenate(
            [sum(jacobian[:, o] * basis[o][:, a, None, None] for o in range(3)) for a in range(DEGREE + 1)], axis=2
        )
        return stacked[live], errors.weighted[here][live]

    def errors(self, x: Array, with_jacobian: bool) -> _Errors:
        """Nonlinear errors of a change: torques (51), wrench (6), slip (24), depth (8), limits (51)."""
        w, m = self.w, len(self.change.times)
        state = self.change.states(x.reshape(-1, N_TANGENT))
        dynamics = _Dynamics(self, state, with_jacobian)
        demand = dynamics.demand
        grip = self.floor.grip(demand, self.pushing)
        columns = demand.columns()
        residual = demand.wrench - np.einsum("mij,mj->mi", columns, grip)
        weight = self.floor.body_weight
        scale = np.where(self.pushing.any(axis=1), 1.0, w.flight)[:, None] / weight
        scale = scale * np.repeat([w.force, w.moment], 3)
        slip = w.slip * self.pinned * (demand.spheres - self.places)
        low = w.depth * np.minimum(demand.spheres[:, :, 2] - CONTACT_RADIUS - self.clearance, 0.0) * ~self.grounded
        vectors = quaternions.logarithm(state.q[:, 7:].reshape(m, 17, 4)).reshape(m, 51)
        excess = vectors - np.clip(vectors, self.low, self.high)
        share = demand.torque_on(grip) / torque_limit()
        strain = share - np.clip(share, -_STRONG, _STRONG)
        parts = [w.strain * strain, scale * residual, slip.reshape(m, 24), low, w.limit * excess]
        weighted = np.concatenate(parts, axis=1)
        if not with_jacobian:
            return _Errors(weighted, None, residual)
        answer = self.floor.answer(demand, grip)
        projection = np.eye(6) - columns @ answer
        pushes = grip.reshape(m, 8, 4) @ EDGES
        jacobian = np.zeros((m, 3, weighted.shape[1], N_TANGENT))
        moving = dynamics.wrench
        arms = np.zeros((m, 6, N_TANGENT))
        for sphere in range(8):
            # Moments of the forces change with their arms.
            arms[:, 3:] -= _cross(pushes[:, sphere]) @ (dynamics.spheres[:, sphere] - dynamics.com)
        moving[:, 0] -= arms
        jacobian[:, :, _N:_W] = scale[:, None, :, None] * np.einsum("mij,mojn->moin", projection, moving)
        jacobian[:, 0, _W:_S] = (w.slip * self.pinned[..., None] * dynamics.spheres).reshape(m, 24, N_TANGENT)
        jacobian[:, 0, _S:_D] = w.depth * (low < 0)[:, :, None] * dynamics.spheres[:, :, 2]
        jacobian[:, 0, _D:][:, :, 6:] = w.limit * (excess != 0)[:, :, None] * np.eye(51)
        hot = np.flatnonzero(np.any(strain != 0, axis=1))
        if len(hot):
            gain = w.strain * (strain[hot] != 0) / torque_limit()
            follows = demand.levers()[hot] @ answer[hot]
            torque = dynamics.torque[hot] - np.einsum("mti,moin->motn", follows, moving[hot])
            torque[:, 0] -= dynamics.leaning(pushes, hot)
            jacobian[hot, :, :_N] = gain[:, None, :, None] * torque
        return _Errors(weighted, jacobian, residual)


class _Dynamics:
    """Inverse dynamics of sampled states, and how they follow place, velocity and acceleration in the tangent."""

    def __init__(self, problem: _Problem, state: State, with_jacobian: bool) -> None:
        model, d = problem.model, problem.data
        m = len(state.q)
        force, spheres, com = np.empty((m, N_TANGENT)), np.empty((m, 8, 3)), np.empty((m, 3))
        bodies = [1 + body for body in _LEGS]
        anchors, frames, root = np.empty((m, 6, 3)), np.empty((m, 6, 9)), np.empty((m, 3, 3))
        many = m if with_jacobian else 0
        by = np.zeros((many, 3, N_TANGENT, N_TANGENT))
        self.spheres, self.com = np.zeros((many, 8, 3, N_TANGENT)), np.zeros((many, 3, N_TANGENT))
        self.anchors, self.turns = np.zeros((2, many, 6, 3, N_TANGENT))
        result, moved, full = np.zeros(N_TANGENT), np.zeros(model.nq), np.empty((N_TANGENT, N_TANGENT))
        step = np.zeros(N_TANGENT)
        kinematics, places, rates, inverse = mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel, mujoco.mj_rne
        for k in range(m):
            d.qpos[:], d.qvel[:], d.qacc[:] = state.q[k], state.v[k], state.a[k]
            kinematics(model, d)
            places(model, d)
            rates(model, d)
            inverse(model, d, 1, result)
            force[k], spheres[k], com[k] = result, d.geom_xpos[problem.spheres], d.subtree_com[1]
            anchors[k], frames[k], root[k] = d.xpos[bodies], d.xmat[bodies], d.xmat[1].reshape(3, 3)
            if not with_jacobian:
                continue
            for i, geom in enumerate(problem.spheres):
                mujoco.mj_jac(model, d, self.spheres[k, i], None, spheres[k, i], int(model.geom_bodyid[geom]))
            for i, body in enumerate(bodies):
                mujoco.mj_jac(model, d, self.anchors[k, i], self.turns[k, i], anchors[k, i], body)
            mujoco.mj_jacSubtreeCom(model, d, self.com[k], 1)
            mujoco.mj_crb(model, d)
            _full_mass(model, d, full)
            by[k, 2] = full
            qvel, qpos, here = d.qvel, d.qpos, state.q[k]
            for i in range(3, N_TANGENT):
                qvel[i] += _RATE
                rates(model, d)
                inverse(model, d, 1, result)
                qvel[i] = state.v[k, i]
                by[k, 1, :, i] = (result - force[k]) / _RATE
            for i in range(3, N_TANGENT):
                step[i] = _ANGLE
                moved[:] = here
                mujoco.mj_integratePos(model, moved, step, 1.0)
                step[i] = 0.0
                qpos[:] = moved
                kinematics(model, d)
                places(model, d)
                rates(model, d)
                inverse(model, d, 1, result)
                by[k, 0, :, i] = (result - force[k]) / _ANGLE
        arm = com - state.q[:, :3]
        moment = np.einsum("mij,mj->mi", root, force[:, 3:6]) - np.cross(arm, force[:, :3])
        wrench = np.concatenate((force[:, :3], moment), axis=1)
        self.demand = Demand(spheres, com, wrench, force[:, 6:], anchors, frames.reshape(m, 6, 3, 3))
        if with_jacobian:
            self._complete(state, by, force, root, arm)

    def _complete(self, state: State, by: Array, force: Array, root: Array, arm: Array) -> None:
        """Derivatives of the wrench about the centre of mass and of the legs' torques."""
        m = len(arm)
        turning = _cross(state.v[:, 3:].reshape(m, 18, 3))
        spinning = _cross(state.a[:, 3:].reshape(m, 18, 3))
        for j in range(18):
            # A change in a segment's own frame carries its velocity and acceleration with it.
            c = slice(3 + 3 * j, 6 + 3 * j)
            by[:, 0, :, c] += by[:, 1, :, c] @ turning[:, j] + by[:, 2, :, c] @ spinning[:, j]
            by[:, 1, :, c] += by[:, 2, :, c] @ turning[:, j]
        self.wrench = np.empty((m, 3, 6, N_TANGENT))
        self.wrench[:, :, :3] = by[:, :, :3]
        self.wrench[:, :, 3:] = root[:, None] @ by[:, :, 3:6] - _cross(arm)[:, None] @ by[:, :, :3]
        self.wrench[:, 0, 3:, 3:6] -= root @ _cross(force[:, 3:6])
        shifted = self.com.copy()
        shifted[:, :, :3] -= np.eye(3)
        self.wrench[:, 0, 3:] += _cross(force[:, :3]) @ shifted
        self.torque = by[:, :, 6:]

    def leaning(self, pushes: Array, states: npt.NDArray[np.intp]) -> Array:
        """How the torques of forces that stay follow the place, d(Jᵀ)/dx f: shape (n, 51, 57).

        Parameters
        ----------
        pushes : Array
            Forces of the floor, shape (m, 8, 3) [N].
        states : array of int, shape (n,)
            Of which states.
        """
        demand, leaning = self.demand, np.zeros((len(states), 51, N_TANGENT))
        soles = demand.spheres[states] - (0.0, 0.0, CONTACT_RADIUS)
        for leg, body in enumerate(_LEGS):
            mine = slice(0, 4) if leg < 3 else slice(4, 8)
            force, anchor = pushes[states, mine], demand.anchors[states, leg]
            moment = np.cross(soles[:, mine] - anchor[:, None], force).sum(1)
            moved = self.spheres[states, mine] - self.anchors[states, leg, None]
            change = -(_cross(force) @ moved).sum(1) + _cross(moment) @ self.turns[states, leg]
            leaning[:, 3 * (body - 1) : 3 * body] = demand.frames[states, leg].transpose(0, 2, 1) @ change
        return leaning


def _clearance(schedule: Stances, fps: float, closed: bool) -> Array:
    """Least heights of the parts of the feet that swing [m], rising from where they stand, shape (n, 8).

    A foot that swings a few millimetres over the floor is taken for a standing one by whatever follows the motion.
    """
    grounded = schedule.standing | schedule.sliding
    n = len(grounded)
    laps = np.tile(grounded, (3, 1)) if closed else grounded
    here = slice(n, 2 * n) if closed else slice(0, n)
    clearance = np.zeros((n, 8))
    for foot in range(2):
        mine = slice(4 * foot, 4 * foot + 4)
        swings = ~laps[:, mine].any(axis=1)
        for sphere in range(4 * foot, 4 * foot + 4):
            stands = np.flatnonzero(laps[:, sphere])
            if not len(stands):
                continue
            frames = np.arange(len(laps))
            after = np.searchsorted(stands, frames)
            away = np.minimum(
                np.abs(frames - stands[np.minimum(after, len(stands) - 1)]),
                np.abs(frames - stands[np.maximum(after - 1, 0)]),
            )
            least = np.where(swings, _SWING, _ROLL) * np.minimum(away / (_RISE * fps), 1.0)
            clearance[:, sphere] = least[here]
    return clearance


def _full_mass(model: mujoco.MjModel, data: mujoco.MjData, full: Array) -> None:
    """M as a full matrix, whichever way this version of MuJoCo is asked for it."""
    try:
        mujoco.mj_fullM(model, data, full)  # pyright: ignore[reportCallIssue, reportArgumentType]
    except TypeError:
        mujoco.mj_fullM(model, full, data.qM)  # pyright: ignore[reportCallIssue, reportArgumentType, reportAttributeAccessIssue]


def _cross(w: Array) -> Array:
    """Matrices [w]× of vectors, shape (..., 3) → (..., 3, 3)."""
    zero = np.zeros(w.shape[:-1])
    rows = ((zero, -w[..., 2], w[..., 1]), (w[..., 2], zero, -w[..., 0]), (-w[..., 1], w[..., 0], zero))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def contact_residual(clip: Clip, schedule: Stances) -> float:
    """RMS of the force that these contacts cannot give a clip as it is [body weights]."""
    change = Change(clip, _KNOT, _STEP)
    problem = _Problem(change, schedule, _WEIGHTS)
    errors = problem.errors(np.zeros(change.n_points * N_TANGENT), False)
    return float(np.sqrt(np.mean(np.sum(errors.residual[:, :3] ** 2, axis=1)))) / problem.floor.body_weight
