r"""Contact forces of a motion: whole-body inverse dynamics, and the friction forces that match it best.

.. math:: f^* = \arg\min_{f \ge 0} \lVert S (w - A f) \rVert^2 + \epsilon^2 \lVert f \rVert^2, \qquad r = w - A f^*

w is the wrench about the centre of mass that the Newton–Euler equations of the whole figure require (the root's rows of
M q̈ + c), the columns of A are the wrenches of unit forces along the edges of the standing spheres' friction pyramids, S
weighs moments against forces, and r is the **residual wrench**. Everything works on batches of m states, with the k = 8
contact spheres of the feet, or with those and the 2 of the palms, k = 10.

The pyramids' edges lie on the round cone, along the diagonals of x and y. Those of the tracking controller
(`sim.body.contact_forces`) lie along x and y, on a cone 0.9 times as wide. Either direction would do for both: with its
directions here, the residuals of three prepared captures and of the embedded clips change by at most 0.1 % of body
weight, and torques by at most 3 % of their limits. With these directions there, the residual of the jump is 3.2 % of
weight instead of 2.9, that of the run 1.5 instead of 1.7, and those of six other clips the same to 0.02; the backflip
on repeat falls either way.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from geometry.arrays import Array, Mask
from geometry.physics import FRICTION
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS, figure_model
from models.mocap.dynamics.inverse_dynamics import SegmentPlaces, inverse_dynamics

_REGULARISATION = 0.01  # ε: makes the forces unique, shared between spheres, and continuous in the state
_PYRAMID_SLOPE = FRICTION / np.sqrt(2)  # so that the pyramid lies inside the friction cone
EDGES = np.array([(x * _PYRAMID_SLOPE, y * _PYRAMID_SLOPE, 1.0) for x in (-1, 1) for y in (-1, 1)])
ALL_CONTACTS = FOOT_CONTACTS + HAND_CONTACTS


class Carrier(NamedTuple):
    """A segment whose joint is loaded by the forces on some contact spheres.

    Attributes
    ----------
    body : int
        Index into `BODIES`.
    spheres : slice
        The spheres at the end of its limb, of `ALL_CONTACTS`.
    """

    body: int
    spheres: slice


def _all_carriers() -> tuple[Carrier, ...]:
    """The carriers of the legs, then those of trunk and arms, which carry the load on the palms."""
    n, found = len(FOOT_CONTACTS), list[Carrier]()
    for part, spheres in (("left", slice(0, n // 2)), ("right", slice(n // 2, n))):
        found += [Carrier(BODIES.index(f"{part}_{name}"), spheres) for name in ("thigh", "shank", "foot")]
    found += [Carrier(BODIES.index(name), slice(n, n + 2)) for name in ("abdomen", "chest")]
    for palm, side in enumerate(("left", "right"), start=n):
        arm = ("clavicle", "upper_arm", "forearm", "hand")
        found += [Carrier(BODIES.index(f"{side}_{name}"), slice(palm, palm + 1)) for name in arm]
    return tuple(found)


_CARRIERS = _all_carriers()


def carriers(spheres: int) -> tuple[Carrier, ...]:
    """The 6 or 16 segments whose joints are loaded by the first 8 or by all 10 contact spheres of `ALL_CONTACTS`."""
    return tuple(carrier for carrier in _CARRIERS if carrier.spheres.stop <= spheres)


class RequiredWrench(NamedTuple):
    """Inverse dynamics of m states, and the geometry of their contacts.

    Attributes
    ----------
    spheres : (m, k, 3) array
        Centres of the contact spheres in W [m].
    com : (m, 3) array
        Centre of mass in W [m].
    wrench : (m, 6) array
        Required force, and moment about the centre of mass, in W [N, N m].
    force : (m, 57) array
        Generalised forces without contact forces: of the root, in its own frame, and the joint torques [N, N m].
    places : SegmentPlaces
        The segments.
    """

    spheres: Array
    com: Array
    wrench: Array
    force: Array
    places: SegmentPlaces

    @property
    def torque(self) -> Array:
        """Joint torques without contact forces, shape (m, 51) [N m]."""
        return self.force[:, 6:]

    def columns(self) -> Array:
        """A: wrenches about the centre of mass of a unit force along every edge of every sphere, shape (m, 6, 4k)."""
        arms = self.spheres - self.com[:, None] - (0.0, 0.0, CONTACT_RADIUS)
        moments = np.cross(arms[:, :, None], EDGES)
        edges = np.broadcast_to(EDGES, moments.shape)
        return np.concatenate([edges, moments], axis=-1).reshape(len(arms), -1, 6).transpose(0, 2, 1)

    def levers(self) -> Array:
        """Jᵀ: joint torques due to a unit force along every edge of every sphere, shape (m, 51, 4k)."""
        m, k = self.spheres.shape[:2]
        soles = self.spheres - (0.0, 0.0, CONTACT_RADIUS)
        levers = np.zeros((*self.torque.shape, 4 * k))
        for body, loading in carriers(k):
            arms = soles[:, loading] - self.places.joints[:, body, None]
            moments = np.cross(arms[:, :, None], EDGES).reshape(m, -1, 3)
            torques = np.einsum("mij,mei->mje", self.places.frames[:, body], moments)
            levers[:, 3 * (body - 1) : 3 * body, 4 * loading.start : 4 * loading.stop] = torques
        return levers

    def torque_on(self, grip: Array) -> Array:
        """τ − Jᵀ f: joint torques under contact forces `grip` (m, 4k) [N], shape (m, 51) [N m]."""
        m, k = self.spheres.shape[:2]
        soles, forces = self.spheres - (0.0, 0.0, CONTACT_RADIUS), grip.reshape(m, k, 4) @ EDGES
        torque = self.torque.copy()
        for body, loading in carriers(k):
            moment = np.cross(soles[:, loading] - self.places.joints[:, body, None], forces[:, loading]).sum(axis=1)
            torque[:, 3 * (body - 1) : 3 * body] -= np.einsum("mij,mi->mj", self.places.frames[:, body], moment)
        return torque


class Floor:
    """Finds contact forces for demands of the default figure.

    Parameters
    ----------
    moment_per_force : float
        S: weight of a residual moment relative to a residual force [1/m].
    spheres : tuple of str
        Contact spheres that may bear load: `FOOT_CONTACTS` or `ALL_CONTACTS`.

    Attributes
    ----------
    body_weight : float
        Weight of the figure [N].
    segments : list of int
        Segments of the spheres, as in `SegmentPlaces`.
    """

    def __init__(self, moment_per_force: float = 2.0, spheres: tuple[str, ...] = FOOT_CONTACTS) -> None:
        model = figure_model()
        self.body_weight = float(model.body_subtreemass[0] * -model.opt.gravity[2])
        geoms = [model.geom(name).id for name in spheres]
        self.segments: list[int] = (model.geom_bodyid[geoms] - 1).tolist()
        self._offsets = model.geom_pos[geoms]
        self._mass_shares = model.body_mass[1:] / model.body_subtreemass[1]
        self._scale = np.repeat([1.0, moment_per_force], 3)

    def demand(self, q: Array, v: Array, a: Array) -> RequiredWrench:
        """Inverse dynamics of states, shapes (m, 75), (m, 57), (m, 57)."""
        force, places = inverse_dynamics(q, v, a)
        offsets = np.einsum("mkij,kj->mki", places.frames[:, self.segments], self._offsets)
        com = self._mass_shares @ places.centres
        about_root = np.einsum("mij,mj->mi", places.frames[:, 0], force[:, 3:6])
        moment = about_root - np.cross(com - q[:, :3], force[:, :3])
        wrench = np.concatenate((force[:, :3], moment), axis=1)
        return RequiredWrench(places.joints[:, self.segments] + offsets, com, wrench, force, places)

    def grip(self, demand: RequiredWrench, standing: Mask) -> Array:
        """f*: forces along the pyramids' edges, shape (m, 4k) [N]; only spheres in `standing` (m, k) bear load."""
        columns = self._scale[:, None] * demand.columns()
        grip = np.zeros((len(columns), columns.shape[2]))
        for k, loaded in enumerate(standing):
            edges = np.flatnonzero(np.repeat(loaded, 4))
            if len(edges):
                system = np.concatenate([columns[k][:, edges], _REGULARISATION * np.eye(len(edges))])
                grip[k, edges] = nnls(system, np.concatenate([self._scale * demand.wrench[k], np.zeros(len(edges))]))[0]
        return grip

    def residual_norm(self, demand: RequiredWrench, standing: Mask) -> Array:
        """‖S (w − A f*)‖: residual under contact at the spheres in `standing` (m, k), shape (m,) [body weights]."""
        weighted_residual = self._scale * residual(demand, self.grip(demand, standing))
        return np.linalg.norm(weighted_residual, axis=1) / self.body_weight

    def answer(self, demand: RequiredWrench, grip: Array) -> Array:
        """K: derivative of f* by the wrench for a fixed set of loaded edges, df* = K dw, shape (m, 4k, 6)."""
        columns = (self._scale[:, None] * demand.columns()) * (grip > 0)[:, None]
        gram = columns @ columns.transpose(0, 2, 1) + _REGULARISATION**2 * np.eye(6)
        return columns.transpose(0, 2, 1) @ np.linalg.solve(gram, np.broadcast_to(np.diag(self._scale), gram.shape))


def residual(demand: RequiredWrench, grip: Array) -> Array:
    """Residual wrench r = w − A f under contact forces f, shape (m, 6) [N, N m]."""
    return demand.wrench - np.einsum("mij,mj->mi", demand.columns(), grip)
