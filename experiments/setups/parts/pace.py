r"""The pace of a hand that a field leads: the Phantom's friction and inertia slow it, and `paced` compensates for that.

A field that pulls the hand along with the force b (φ̇ − ṗ) lets it lag. Where the tip moves at speed v along the curve
and the joints at q̇, the power b (φ̇ − v) v goes into friction, Σ_k (f_k |q̇_k| + d_k q̇_k²) with the Coulomb friction f
and the viscous friction d of `models.phantom`, and into the kinetic energy T = ½ q̇ᵀ M(q) q̇ of the linkage. On a bend,
the spring that holds the linkage to the curve is stretched: the tip runs outside the curve on a longer path, and a map
that takes the angle for the clip's phase plays more slowly. Flights are sensitive to pace: a flight played at nine
tenths of its speed needs eight tenths of gravity, and one whose pace changes by a hundredth lands a centimetre off.
"""

from functools import lru_cache

import numpy as np

from controllers.checks import check_kind, checked
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from geometry.arrays import Array
from models.phantom.dynamics import coriolis_matrix, mass_matrix
from models.phantom.kinematics import jacobian, vector_to_device_frame
from models.phantom.parameters import PREMIUM_1_5
from sim.world.world import phantom_angles

# Step to either side for the finite difference of joint rates [s]: half or twice this value changes a friction of 2 mN
# by 2e-8 N at most.
_TIME_STEP = 1e-3
# Largest relative lengthening of the path: beyond, the spring is too soft to keep the tip on the curve.
_MAX_LENGTHENING = 0.5


def friction_along(curve: Trajectory, phases: Array) -> Array:
    """Friction [N] against a tip that moves along a curve at the curve's pace, at phases (n,) [s]; 0 where it rests.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    coulomb, viscous = np.array(PREMIUM_1_5.coulomb_friction), np.array(PREMIUM_1_5.viscous_friction)
    force = np.zeros(len(phases))
    for k, (rates, v) in enumerate(zip(_joint_rates(curve, phases), curve.velocity(phases), strict=True)):
        speed = float(np.linalg.norm(v))
        if speed > 0.0:
            force[k] = float(np.abs(rates) @ coulomb + rates**2 @ viscous) / speed
    return force


def inertia_along(curve: Trajectory, phases: Array) -> tuple[Array, Array]:
    r"""Inertial force f = J⁻ᵀ (M q̈ + C q̇) of the linkage on a curve at the curve's own pace, at phases (n,) [s].

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    phases : Array
        [s].

    Returns
    -------
    along, bending : Array
        Shape (n,): the component along the curve, f·φ̇/\|φ̇\| [N], and f·κ with the curvature vector κ [N/m]; 0 where
        the curve rests.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    first, last = (-np.inf, np.inf) if curve.periodic else (curve.start, curve.end)
    ahead, behind = np.minimum(phases + _TIME_STEP, last), np.maximum(phases - _TIME_STEP, first)
    changes = (_joint_rates(curve, ahead) - _joint_rates(curve, behind)) / (ahead - behind)[:, None]
    along, bending = np.zeros(len(phases)), np.zeros(len(phases))
    velocities, accelerations = curve.velocity(phases), curve.acceleration(phases)
    for k, (p, rates) in enumerate(zip(curve.point(phases), _joint_rates(curve, phases), strict=True)):
        v, a = (np.array(vector_to_device_frame.py_func(tuple(x))) for x in (velocities[k], accelerations[k]))
        speed = float(np.linalg.norm(v))
        if speed > 0.0:
            theta = phantom_angles(p)
            mass, coriolis = mass_matrix.py_func(theta), coriolis_matrix.py_func(theta, tuple(rates))
            force = np.linalg.solve(np.transpose(jacobian.py_func(theta)), mass @ changes[k] + coriolis @ rates)
            along[k] = force @ v / speed
            bending[k] = force @ (a - (a @ v) * v / speed**2) / speed**2
    return along, bending


def _joint_rates(curve: Trajectory, phases: Array) -> Array:
    """Joint rates q̇ of the linkage on a curve at the curve's own pace, shape (n, 3) [rad/s]."""
    rates = [
        np.linalg.solve(jacobian.py_func(phantom_angles(p)), vector_to_device_frame.py_func(tuple(v)))
        for p, v in zip(curve.point(phases), curve.velocity(phases), strict=True)
    ]
    return np.array(rates, dtype=np.float64)


def paced(curve: Trajectory, drag: float, stiffness: float) -> Trajectory:
    r"""A curve in the same place, timed so that a field of drag b and stiffness k leads the Phantom at the old pace.

    .. math:: |\dot\varphi'| = |\dot\varphi|\,(1 + f\cdot\kappa/k) + f_t/b, \qquad
              dt' = dt\,|\dot\varphi|\,/\,|\dot\varphi'|

    with f_t the sum of `friction_along` and the tangential part of `inertia_along`, and f·κ of the latter: the tip runs
    f/k outside the curve. The new speed is at least half of the old one, also where the decelerating linkage would need
    less, and f·κ/k is limited to ±½. The curve goes through the same points; the stylus is upright.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    drag : float
        b [N s/m], positive.
    stiffness : float
        k [N/m]; with 0 the lengthening on bends is left out.

    Raises
    ------
    ParameterError
        If the drag is not positive and finite, the stiffness is negative or NaN, or the curve is no trajectory.
    SimError
        If the Phantom does not reach the curve.
    """
    check_kind("curve", curve, Trajectory)
    checked("stiffness", stiffness, "N/m", infinite=True)
    if checked("drag", drag, "N s/m") == 0.0:
        raise ParameterError(
            f"drag must be more than 0 N s/m, got {drag}: without it no field leads a hand at a given speed"
        )
    times = np.asarray(curve.times)
    own, middles = np.diff(times), 0.5 * (times[1:] + times[:-1])
    speed = np.linalg.norm(curve.velocity(middles), axis=1)
    along, bending = inertia_along(curve, middles)
    longer = np.clip(bending / stiffness, -_MAX_LENGTHENING, _MAX_LENGTHENING) if stiffness > 0.0 else 0.0
    needed = drag * speed * (1.0 + longer) + friction_along(curve, middles) + along
    pulled = np.maximum(needed, 0.5 * drag * speed)
    # Where the curve rests, its timing is kept.
    steps = own * np.divide(drag * speed, pulled, out=np.ones_like(own), where=pulled > 0.0)
    return Trajectory(times[0] + np.append(0.0, np.cumsum(steps)), curve.positions, periodic=curve.periodic)


def compensation(curve: Trajectory, course: Trajectory) -> float:
    """Share of the speed of `course_of` a curve that compensates for friction and inertia, on average; 0 or more."""
    return max(0.0, 1.0 - course.duration / curve.duration)


def check_reach(curve: Trajectory) -> Trajectory:
    """The same curve, checked to lie within the Phantom's reach.

    Raises
    ------
    SimError
        If the Phantom does not reach it.
    """
    for phase in np.linspace(curve.start, curve.end, 64):
        phantom_angles(curve.point(phase))
    return curve


@lru_cache(maxsize=16)
def course_of(curve: Trajectory, drag: float, stiffness: float) -> Trajectory:
    """The curve along which a field leads so that the hand has the pace of `curve`: `paced`, or itself without drag.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    return paced(curve, drag, stiffness) if drag > 0.0 else curve
