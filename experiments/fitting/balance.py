"""Balanced blends: the root of a map's in-betweens sways so that the zero-moment point lies within the support.

A mean of balanced motions is not balanced: its centre of mass and its feet are at the means of the clips', but the
stance foot need not be under the zero-moment point. For every mixture of the clips the zero-moment point p of a lap is
compared with the nearest supported point p* of the floor, and the root is moved by the sway of the cart-table model for
the error p* − p (`models.mocap.dynamics.zero_moment_point`).

The clips' own imbalance, interpolated by the weights of the mixture, is not corrected: a clip alone does not sway. A
led figure does, if its clip is a capture or its gait is too slow to fly.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.led import Led
from controllers.legs.sole_heights import SWING_HEIGHT
from controllers.walking.gait import Gait
from experiments.files.array_cache import cached_array
from geometry.arrays import Array
from geometry.physics import GRAVITY
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS
from models.mocap.dynamics.zero_moment_point import nearest_supported, sway_of, zero_moment_point
from sim.body.falls import TOUCH_HEIGHT
from sim.reference.reference import map_poses

_LAP_SAMPLES, _LED_LAP_SAMPLES = 96, 192  # samples of a lap
_ITERATIONS, _LED_ITERATIONS = 3, 6  # each corrects the remaining error of the zero-moment point
_LED_PACE = 0.8  # pace at which the sway of a led figure is computed, over the gait's own
_CUTOFF = 6.0  # highest frequency of the sway [Hz]
_SUPPORT_SCALE = 0.6  # the zero-moment point is to lie within the support scaled by this factor about its middle
_MAX_SWAY = 0.2  # largest sway [m]


class Laps(NamedTuple):
    """Dynamics of laps of k motions.

    Attributes
    ----------
    zmp : Array, shape (k, n, 2)
        Zero-moment points on the floor [m].
    load : Array, shape (k, n)
        Vertical force in body weights.
    contacts : Array, shape (k, n, 8, 3)
        Lowest points of the feet's contact spheres [m].
    height : float
        Mean height of the centre of mass [m].
    """

    zmp: Array
    load: Array
    contacts: Array
    height: float

    def outside(self) -> Array:
        """Vectors from zero-moment points to nearest supported ones [m] times the load [body weights], (k, n, 2)."""
        touching = self.contacts[..., 2] < SWING_HEIGHT
        nearest = nearest_supported(self.zmp, self.contacts[..., :2], touching, _SUPPORT_SCALE)
        return self.load[..., None] * (nearest - self.zmp)


def with_balance(haptic_map: Cylindrical, figure: mujoco.MjModel, lap: float) -> Cylindrical:
    """The same map with a root that sways between the clips; the result is cached beside the compiled code.

    Parameters
    ----------
    haptic_map : Cylindrical
        Map with limbs.
    figure : mujoco.MjModel
        Model of the figure alone.
    lap : float
        Duration of a lap [s].
    """
    shape = (_LAP_SAMPLES, len(haptic_map.mixtures), 2)
    model = np.empty(mujoco.mj_sizeModel(figure), dtype=np.uint8)
    mujoco.mj_saveModel(figure, None, model)
    made_of = (haptic_map.compiled().params, haptic_map.mixtures, haptic_map.drifts, model, np.array([lap]))
    return haptic_map.with_sway(
        cached_array(__name__, "sway", made_of, shape, lambda: _compute_sway(haptic_map, figure, lap))
    )


def _compute_sway(haptic_map: Cylindrical, figure: mujoco.MjModel, lap: float) -> Array:
    weights = haptic_map.mixtures
    single_clips = weights.argmax(axis=0)
    # The poses begin one sample before the seam, so the samples that are measured lie in the map's second lap.
    turn = -np.outer(weights @ haptic_map.drifts[:, 2], 1.0 + np.arange(_LAP_SAMPLES) / _LAP_SAMPLES)
    sway = np.zeros((_LAP_SAMPLES, len(weights), 2))
    for k in range(_ITERATIONS):
        laps = _lap_dynamics(haptic_map.with_sway(sway) if k > 0 else haptic_map, figure, lap)
        outside = laps.outside()
        clip_outside = outside[single_clips]
        outside -= np.einsum("km,mnx->knx", weights, clip_outside)
        c, s = np.cos(turn), np.sin(turn)
        x, y = outside[..., 0], outside[..., 1]
        error = np.stack([c * x - s * y, s * x + c * y], axis=-1).transpose(1, 0, 2)
        sway += sway_of(error, laps.height, lap, _CUTOFF)
        length = np.linalg.norm(sway, axis=-1, keepdims=True)
        sway *= np.minimum(1.0, _MAX_SWAY / np.maximum(length, 1e-12))
    return sway


def balanced_on_ground(led: Led, gait: Gait, figure: mujoco.MjModel) -> Led:
    """The same map with a sway of its flightless form that keeps the zero-moment point supported at 0.8 of its pace."""
    if not led.has_grounded_form:
        return led
    sway, result, seconds = np.zeros((_LED_LAP_SAMPLES, 2)), led, gait.stride / (_LED_PACE * gait.speed)
    walker_states = np.zeros((_LED_LAP_SAMPLES + 2, 7))
    walker_states[:, 0] = led.stride * (np.arange(-1, _LED_LAP_SAMPLES + 1) / _LED_LAP_SAMPLES - led.phase)
    walker_states[:, 1] = walker_states[:, 3] = 1.0
    for _ in range(_LED_ITERATIONS):
        laps = _measured_laps(map_poses(result, walker_states)[None], seconds / _LED_LAP_SAMPLES, figure)
        outside = laps.outside()
        # In flights the mean root position is the clip's own: a constant offset would have to be undone there, which
        # would throw the figure.
        mean = outside[0].mean(axis=0) if gait.flies else 0.0
        sway += sway_of(outside[0] - mean, laps.height, seconds, _CUTOFF)
        swaying = led.with_sway(sway)
        if not swaying.has_grounded_form:
            # This sway would need too low a root, so the previous one is kept.
            break
        result = swaying
    return result


def imbalance_at_rest(led: Led, phases: Array, figure: mujoco.MjModel) -> Array:
    """Distances (n,) [m] of the centre of mass from the support of a led figure that stands still at phases of its lap.

    Only points that the physical figure takes as touching support it: it does not sink onto those above.
    """
    walker_states = np.zeros((len(phases) + 2, 7))
    walker_states[1:-1, 0] = led.stride * (phases - led.phase)
    walker_states[:, 1] = walker_states[:, 3] = 1.0
    at_rest = _measured_laps(map_poses(led, walker_states)[None], np.inf, figure)
    touching = at_rest.contacts[..., 2] < TOUCH_HEIGHT
    nearest = nearest_supported(at_rest.zmp, at_rest.contacts[..., :2], touching, 1.0)
    distance = np.linalg.norm(nearest - at_rest.zmp, axis=-1)
    return np.where(touching.any(axis=-1), distance, np.inf)[0]


def _lap_dynamics(haptic_map: Cylindrical, figure: mujoco.MjModel, lap: float) -> Laps:
    places = haptic_map.places(2.0 * np.pi * np.arange(-1, _LAP_SAMPLES + 1) / _LAP_SAMPLES)
    poses = np.stack([map_poses(haptic_map, stylus) for stylus in places])
    return _measured_laps(poses, lap / _LAP_SAMPLES, figure)


def _measured_laps(poses: Array, step: float, figure: mujoco.MjModel) -> Laps:
    """Dynamics of laps of poses (k, n + 2, 75) a time `step` [s] apart, with one pose before and one after each lap.

    Angular momenta are those of backward differences: the difference of two of them is centred, at the pose between.
    """
    data = mujoco.MjData(figure)
    feet = [figure.geom(name).id for name in FOOT_CONTACTS]
    k, n = poses.shape[:2]
    com, angular_momentum, contacts = np.empty((k, n, 3)), np.empty((k, n, 3)), np.empty((k, n, len(feet), 3))
    velocity = np.empty(figure.nv)
    for node in range(k):
        for i in range(n):
            mujoco.mj_differentiatePos(figure, velocity, step, poses[node, max(i - 1, 0)], poses[node, i])
            data.qpos, data.qvel = poses[node, i], velocity
            mujoco.mj_kinematics(figure, data)
            mujoco.mj_comPos(figure, data)
            mujoco.mj_comVel(figure, data)
            mujoco.mj_subtreeVel(figure, data)
            com[node, i], angular_momentum[node, i] = data.subtree_com[1], data.subtree_angmom[1]
            contacts[node, i] = data.geom_xpos[feet]
    acceleration = (com[:, 2:] - 2.0 * com[:, 1:-1] + com[:, :-2]) / step**2
    force = acceleration + np.array([0.0, 0.0, GRAVITY])
    torque = (angular_momentum[:, 2:] - angular_momentum[:, 1:-1]) / (step * figure.body_subtreemass[1])
    com = com[:, 1:-1]
    force[..., 2] = np.maximum(force[..., 2], 0.1 * GRAVITY)
    contacts[..., 2] -= CONTACT_RADIUS
    zmp = zero_moment_point(com, force, torque)
    return Laps(zmp, force[..., 2] / GRAVITY, contacts[:, 1:-1], float(com[..., 2].mean()))
