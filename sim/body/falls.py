r"""Fall detection and recovery: a fallen figure lies for a second and is then set back onto the animation.

The figure has fallen when trunk, head or legs touch the floor while the reference has them well above it, or when it
touches the floor with its root half a metre from the reference's. Its motors are then off. After lying for
`LYING_TIME`, it tracks for `RECOVERY_TIME` an interpolation from the pose (p₀, R₀) in which it lay to the reference
(p, R). The position p of the root is interpolated, and the offset of every rotation R from the reference decays:

.. math:: p(u) = p_0 + S(u)\,(p - p_0) + 16\,u^2 (1 - u)^2\,h\,e_z , \qquad
          R(u) = R\,\exp((1 - S(u))\,\log(R^T R_0)|_{u=0}) , \qquad 0 \le u \le 1 ,

with the smooth step S and an additional height h for foot clearance. Meanwhile an unbounded wrench at the root carries
the figure. It is recorded as the residual, and this time is excluded from all measures of the figure.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from geometry.arrays import Array, IntArray
from geometry.easing import smooth_step
from models.humanoid.skeleton import DEFAULT_STATURE, FOOT_CONTACTS, HAND_CONTACTS, N_POSE, N_TANGENT
from sim.compilation.native import mj_differentiate_pos, mj_integrate_pos

UP, DOWN, RECOVERING = 0.0, 1.0, 2.0
TOUCH_HEIGHT = 2e-3  # [m] height below which a body touches the floor: about the softness of MuJoCo's contacts
# [m] distance of the root from the reference's, beyond which the figure does not recover by itself
MAX_ROOT_DISTANCE = 0.5
LYING_TIME, RECOVERY_TIME = 1.0, 1.0  # [s] duration of lying on the floor, and of the return to the animation
# [m] height above which a reference body is clear of the floor; a standing shank is at 0.058
_REFERENCE_CLEARANCE = 0.05
_CLEARANCE = 0.25  # [m] h at the default stature; the interpolation alone takes the feet 0.15 m below the floor
_MODE, _MODE_TIME, _FALL_COUNT = 0, 1, 2  # indices in `FallState.state`
_ARM_SEGMENTS = ("clavicle", "arm", "forearm", "hand")  # left out: a figure that props itself on a hand has not fallen
_SPHERE, _CAPSULE = int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_CAPSULE)


class FallState(NamedTuple):
    """State of fall detection and recovery. The *twin* is the figure alone, in the reference pose.

    Attributes
    ----------
    period : float
        Period of the control [s].
    clearance : float
        h [m].
    geoms, twin_geoms : IntArray
        Geoms of trunk, head and legs, in the world and in the twin, shape (n,).
    kinds, sizes : IntArray, Array
        Their types, shape (n,), and sizes [m], shape (n, 3).
    pos, mat, twin_pos, twin_mat : Array
        Positions (ngeom, 3) and rotation matrices (ngeom, 9) of all geoms, of the world and of the twin.
    state : Array
        `UP`, `DOWN` or `RECOVERING`; time spent lying or being set back [s]; number of falls; shape (3,).
    lying, way : Array
        p₀ (3,), and the tangent from the reference pose to the pose in which it lay, at that time (57,).
    target, before, velocity, still : Array
        The pose to be tracked and that of one period ago (75,), its velocity, and a zero acceleration (57,).
    """

    period: float
    clearance: float
    geoms: IntArray
    twin_geoms: IntArray
    kinds: IntArray
    sizes: Array
    pos: Array
    mat: Array
    twin_pos: Array
    twin_mat: Array
    state: Array
    lying: Array
    way: Array
    target: Array
    before: Array
    velocity: Array
    still: Array


@njit
def _lowest_height(kind: int, size: Array, pos: Array, mat: Array) -> float:
    """Lowest height of a sphere z − r, capsule z − r − ℓ|d_z| or ellipsoid z − ‖s d‖; d: the vertical in its frame."""
    if kind == _SPHERE:
        return pos[2] - size[0]
    if kind == _CAPSULE:
        return pos[2] - size[0] - size[1] * abs(mat[8])
    return pos[2] - np.sqrt((size[0] * mat[6]) ** 2 + (size[1] * mat[7]) ** 2 + (size[2] * mat[8]) ** 2)


@njit
def update_fall(model: int, fall: FallState, pose: Array, q_r: Array, sole: float) -> float:
    """Update and return the mode of this period: `UP`, `DOWN` or `RECOVERING`.

    Parameters
    ----------
    model : int
        Address of the twin's model.
    fall : FallState
        Updated; the twin must be in the reference pose.
    pose, q_r : Array
        Pose of the figure and of the reference, shape (75,).
    sole : float
        Height of the figure's lowest contact point [m].
    """
    state, lowest, fallen = fall.state, sole, False
    if state[_MODE] == RECOVERING:
        state[_MODE_TIME] += fall.period
        if state[_MODE_TIME] > RECOVERY_TIME:
            state[_MODE] = UP
        return state[_MODE]
    for k in range(fall.geoms.shape[0]):
        kind, size, geom, twin = fall.kinds[k], fall.sizes[k], fall.geoms[k], fall.twin_geoms[k]
        height = _lowest_height(kind, size, fall.pos[geom], fall.mat[geom])
        lowest = min(lowest, height)
        if height < 0.0 and _lowest_height(kind, size, fall.twin_pos[twin], fall.twin_mat[twin]) > _REFERENCE_CLEARANCE:
            fallen = True
    touches = lowest < TOUCH_HEIGHT
    if state[_MODE] == UP:
        root_distance = np.sqrt((pose[0] - q_r[0]) ** 2 + (pose[1] - q_r[1]) ** 2 + (pose[2] - q_r[2]) ** 2)
        if fallen or (touches and root_distance > MAX_ROOT_DISTANCE):
            state[_MODE], state[_MODE_TIME] = DOWN, 0.0
            state[_FALL_COUNT] += 1.0
        return state[_MODE]
    if touches:
        state[_MODE_TIME] += fall.period
    if state[_MODE_TIME] > LYING_TIME:
        state[_MODE], state[_MODE_TIME] = RECOVERING, 0.0
        fall.lying[:] = pose[:3]
        fall.before[:] = pose
        mj_differentiate_pos(model, fall.way.ctypes, 1.0, q_r.ctypes, pose.ctypes)
    return state[_MODE]


@njit
def update_recovery_target(model: int, fall: FallState, q_r: Array) -> None:
    """Write the pose and velocity that a figure tracks while it is set back to `target` and `velocity`.

    `model` is the address of the twin's model.
    """
    u = fall.state[_MODE_TIME] / RECOVERY_TIME
    share = smooth_step(u)
    fall.target[:] = q_r
    mj_integrate_pos(model, fall.target.ctypes, fall.way.ctypes, 1.0 - share)
    for i in range(3):
        fall.target[i] = fall.lying[i] + share * (q_r[i] - fall.lying[i])
    fall.target[2] += 16.0 * (u * (1.0 - u)) ** 2 * fall.clearance
    mj_differentiate_pos(model, fall.velocity.ctypes, fall.period, fall.before.ctypes, fall.target.ctypes)
    fall.before[:] = fall.target


def fall_state(
    model: mujoco.MjModel, data: mujoco.MjData, twin: mujoco.MjModel, twin_data: mujoco.MjData, prefix: str,
    period: float, stature: float,
) -> FallState:  # fmt: skip
    """The state of a figure that has not fallen; for the arguments see `sim.body.figure.Figure`."""
    body_geoms = [
        geom
        for geom in range(twin.ngeom)
        if twin.geom_conaffinity[geom]
        and twin.geom(geom).name not in FOOT_CONTACTS + HAND_CONTACTS
        and not twin.body(twin.geom_bodyid[geom]).name.endswith(_ARM_SEGMENTS)
    ]
    first = int(model.body_geomadr[model.body(prefix + twin.body(1).name).id]) - int(twin.body_geomadr[1])
    geoms = np.array(body_geoms, dtype=np.int64)
    return FallState(
        period=period, clearance=_CLEARANCE * stature / DEFAULT_STATURE, geoms=geoms + first, twin_geoms=geoms,
        kinds=twin.geom_type[geoms].astype(np.int64), sizes=twin.geom_size[geoms].copy(), pos=data.geom_xpos,
        mat=data.geom_xmat, twin_pos=twin_data.geom_xpos, twin_mat=twin_data.geom_xmat, state=np.zeros(3),
        lying=np.zeros(3), way=np.zeros(N_TANGENT), target=np.zeros(N_POSE), before=np.zeros(N_POSE),
        velocity=np.zeros(N_TANGENT), still=np.zeros(N_TANGENT),
    )  # fmt: skip
