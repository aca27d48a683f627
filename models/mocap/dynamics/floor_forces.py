r"""Contact forces of a motion: whole-body inverse dynamics, and the friction forces that match it best.

.. math:: f^* = \arg\min_{f \ge 0} \lVert S (w - A f) \rVert^2 + \epsilon^2 \lVert f \rVert^2, \qquad r = w - A f^*

w is the wrench about the centre of mass that the Newton–Euler equations of the whole figure require (the root's rows of
M q̈ + c), the columns of A are the wrenches of unit forces along the edges of the standing spheres' friction pyramids, S
weighs moments against forces, and r is the **residual wrench**. Everything works on batches of m states.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.optimize import nnls

from models.arrays import Array, Mask
from models.floor import FRICTION
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, N_TANGENT, figure_model

_SHARE = 0.01  # ε, regularisation: makes the forces unique, shared between spheres, and continuous in the state
_SLOPE = FRICTION / np.sqrt(2)  # so that the pyramid lies inside the friction cone
EDGES = np.array([(x * _SLOPE, y * _SLOPE, 1.0) for x in (-1, 1) for y in (-1, 1)])
_N_SPHERES = len(FOOT_CONTACTS)
_LEGS = tuple(BODIES.index(f"{side}_{part}") for side in ("left", "right") for part in ("thigh", "shank", "foot"))


class Demand(NamedTuple):
    """Inverse dynamics of m states, and the geometry of their contacts.

    Attributes
    ----------
    spheres : (m, 8, 3) array
        Centres of the feet's contact spheres in W [m].
    com : (m, 3) array
        Centre of mass in W [m].
    wrench : (m, 6) array
        Required force, and moment about the centre of mass, in W [N, N m].
    torque : (m, 51) array
        Joint torques without contact forces [N m].
    anchors, frames : (m, 6, 3) and (m, 6, 3, 3) arrays
        Positions in W of the leg joints [m], and R_WB of the segments that they move.
    """

    spheres: Array
    com: Array
    wrench: Array
    torque: Array
    anchors: Array
    frames: Array

    def columns(self) -> Array:
        """A: wrenches about the centre of mass of a unit force along every edge of every sphere, shape (m, 6, 32)."""
        arms = self.spheres - self.com[:, None] - (0.0, 0.0, CONTACT_RADIUS)
        moments = np.cross(arms[:, :, None], EDGES)
        edges = np.broadcast_to(EDGES, moments.shape)
        return np.concatenate([edges, moments], axis=-1).reshape(len(arms), 4 * _N_SPHERES, 6).transpose(0, 2, 1)

    def levers(self) -> Array:
        """Jᵀ: joint torques due to a unit force along every edge of every sphere, shape (m, 51, 32)."""
        soles = self.spheres - (0.0, 0.0, CONTACT_RADIUS)
        levers = np.zeros((*self.torque.shape, 4 * _N_SPHERES))
        for leg, body in enumerate(_LEGS):
            mine = slice(0, 4) if leg < 3 else slice(4, 8)
            moments = np.cross((soles[:, mine] - self.anchors[:, leg, None])[:, :, None], EDGES).reshape(-1, 16, 3)
            turned = np.einsum("mij,mei->mje", self.frames[:, leg], moments)
            levers[:, 3 * (body - 1) : 3 * body, 4 * mine.start : 4 * mine.stop] = turned
        return levers

    def torque_on(self, grip: Array) -> Array:
        """τ − Jᵀ f: joint torques under contact forces `grip` (m, 32) [N], shape (m, 51) [N m]."""
        return self.torque - np.einsum("mte,me->mt", self.levers(), grip)


class Floor:
    """Finds contact forces for demands of the default figure.

    Parameters
    ----------
    moment_per_force : float
        S: weight of a residual moment relative to a residual force [1/m].
    """

    def __init__(self, moment_per_force: float = 2.0) -> None:
        self._model = figure_model()
        self._data = mujoco.MjData(self._model)
        self.body_weight = float(self._model.body_subtreemass[0] * -self._model.opt.gravity[2])
        self._geoms = [self._model.geom(name).id for name in FOOT_CONTACTS]
        self._bodies = [self._model.body(BODIES[body]).id for body in _LEGS]
        self._scale = np.repeat([1.0, moment_per_force], 3)

    def demand(self, q: Array, v: Array, a: Array) -> Demand:
        """Inverse dynamics of states, shapes (m, 75), (m, 57), (m, 57)."""
        m, d = len(q), self._data
        force, spheres, com = np.empty((m, N_TANGENT)), np.empty((m, _N_SPHERES, 3)), np.empty((m, 3))
        anchors, frames, root = np.empty((m, 6, 3)), np.empty((m, 6, 9)), np.empty((m, 9))
        for k in range(m):
            d.qpos[:], d.qvel[:], d.qacc[:] = q[k], v[k], a[k]
            mujoco.mj_inverse(self._model, d)
            force[k], spheres[k], com[k] = d.qfrc_inverse, d.geom_xpos[self._geoms], d.subtree_com[1]
            anchors[k], frames[k], root[k] = d.xpos[self._bodies], d.xmat[self._bodies], d.xmat[1]
        about_root = np.einsum("mij,mj->mi", root.reshape(m, 3, 3), force[:, 3:6])
        moment = about_root - np.cross(com - q[:, :3], force[:, :3])
        wrench = np.concatenate([force[:, :3], moment], axis=1)
        return Demand(spheres, com, wrench, force[:, 6:], anchors, frames.reshape(m, 6, 3, 3))

    def grip(self, demand: Demand, standing: Mask) -> Array:
        """f*: forces along the pyramids' edges, shape (m, 32) [N]; only spheres in `standing` (m, 8) bear load."""
        columns = self._scale[:, None] * demand.columns()
        grip = np.zeros((len(columns), 4 * _N_SPHERES))
        for k, stands in enumerate(standing):
            edges = np.flatnonzero(np.repeat(stands, 4))
            if len(edges):
                system = np.concatenate([columns[k][:, edges], _SHARE * np.eye(len(edges))])
                grip[k, edges] = nnls(system, np.concatenate([self._scale * demand.wrench[k], np.zeros(len(edges))]))[0]
        return grip

    def answer(self, demand: Demand, grip: Array) -> Array:
        """K: derivative of f* by the wrench with a fixed set of loaded edges, df* = K dw, shape (m, 32, 6)."""
        columns = (self._scale[:, None] * demand.columns()) * (grip > 0)[:, None]
        inside = columns @ columns.transpose(0, 2, 1) + _SHARE**2 * np.eye(6)
        return columns.transpose(0, 2, 1) @ np.linalg.solve(inside, np.broadcast_to(np.diag(self._scale), inside.shape))


def soles() -> Array:
    """Centres of the contact spheres in the frames of their feet, shape (8, 3) [m]."""
    model = figure_model()
    return np.array([model.geom(name).pos for name in FOOT_CONTACTS])


def residual(demand: Demand, grip: Array) -> Array:
    """Residual wrench r = w − A f that contact forces leave, shape (m, 6) [N, N m]."""
    return demand.wrench - np.einsum("mij,mj->mi", demand.columns(), grip)
