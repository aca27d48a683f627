r"""The pace of a hand that a field leads: what the Phantom takes off it, and a curve that makes up for that.

A field that draws a hand along with b (φ̇ − ṗ) leaves it behind by what the device holds: where the tip goes at v along
a curve and the joints at q̇, b (φ̇ − v) v is the power of friction, Σ_k (f_k |q̇_k| + d_k q̇_k²) with Coulomb's f and the
viscous d of `models.phantom`, and of what changes the kinetic energy T = ½ q̇ᵀ M q̇ of the linkage, whose M depends on
where it is. A spring that keeps the linkage on a bend has to be stretched: the tip goes round outside the curve, on a
longer way, and a map that takes the angle for the clip's phase is played the more slowly. A flight of a clip that is
played at nine tenths of its speed asks for eight tenths of gravity, and one whose pace changes by a hundredth lands a
centimetre from where its figure flew.
"""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.state import Array
from models.phantom.dynamics import coriolis_matrix, mass_matrix
from models.phantom.kinematics import jacobian, vector_to_device_frame
from models.phantom.parameters import PREMIUM_1_5
from sim.world.world import phantom_angles

_STEP = 1e-3  # [s] to both sides, of the derivative of the joints' rates
_LONGER = 0.5  # of a way: beyond that a spring is none that keeps a tip on its curve


def friction_along(curve: Trajectory, phases: Array) -> Array:
    """Force [N] against a tip that goes along a curve at its own pace, at phases (n,) [s]; 0 where it rests.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    coulomb, viscous = np.array(PREMIUM_1_5.coulomb_friction), np.array(PREMIUM_1_5.viscous_friction)
    force = np.zeros(len(phases))
    for k, (p, v) in enumerate(zip(curve.point(phases), curve.velocity(phases), strict=True)):
        speed = float(np.linalg.norm(v))
        if speed > 0.0:
            rates = np.linalg.solve(jacobian.py_func(phantom_angles(p)), vector_to_device_frame.py_func(tuple(v)))
            force[k] = float(np.abs(rates) @ coulomb + rates**2 @ viscous) / speed
    return force


def inertia_along(curve: Trajectory, phases: Array) -> tuple[Array, Array]:
    r"""Force f = J⁻ᵀ (M q̈ + C q̇) that keeps the linkage on a curve at the curve's own pace, at phases (n,) [s].

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    phases : Array
        [s].

    Returns
    -------
    along, bending : Array
        Shape (n,): the part along the curve, f·φ̇/\|φ̇\| [N], and what of it bends the way, f·κ with the vector κ of
        curvature [N/m]; 0 where the curve rests.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    first, last = (-np.inf, np.inf) if curve.periodic else (curve.start, curve.end)
    ahead, behind = np.minimum(phases + _STEP, last), np.maximum(phases - _STEP, first)
    changes = (_rates(curve, ahead) - _rates(curve, behind)) / (ahead - behind)[:, None]
    along, bending = np.zeros(len(phases)), np.zeros(len(phases))
    velocities, accelerations = curve.velocity(phases), curve.acceleration(phases)
    for k, (p, rates) in enumerate(zip(curve.point(phases), _rates(curve, phases), strict=True)):
        v, a = (np.array(vector_to_device_frame.py_func(tuple(x))) for x in (velocities[k], accelerations[k]))
        speed = float(np.linalg.norm(v))
        if speed > 0.0:
            theta = phantom_angles(p)
            mass, coriolis = mass_matrix.py_func(theta), coriolis_matrix.py_func(theta, tuple(rates))
            force = np.linalg.solve(np.transpose(jacobian.py_func(theta)), mass @ changes[k] + coriolis @ rates)
            along[k] = force @ v / speed
            bending[k] = force @ (a - (a @ v) * v / speed**2) / speed**2
    return along, bending


def _rates(curve: Trajectory, phases: Array) -> Array:
    """q̇ of the linkage on a curve at its own pace, shape (n, 3) [rad/s]."""
    rates = [
        np.linalg.solve(jacobian.py_func(phantom_angles(p)), vector_to_device_frame.py_func(tuple(v)))
        for p, v in zip(curve.point(phases), curve.velocity(phases), strict=True)
    ]
    return np.array(rates, dtype=np.float64)


def paced(curve: Trajectory, drag: float, stiffness: float) -> Trajectory:
    r"""A curve in the same place, timed so that a field of drag b and stiffness k leads the Phantom at the old pace.

    .. math:: |\dot\varphi'| = |\dot\varphi|\,(1 + f\cdot\kappa/k) + f_t/b, \qquad
              dt' = dt\,|\dot\varphi|\,/\,|\dot\varphi'|

    with f_t of `friction_along` and `inertia_along`, and f·κ of the latter: the tip goes f/k outside. Where what the
    linkage gives back would ask for less than half of the old speed, it is half of it, and a way that is longer by
    more than half is taken for one that is. The curve goes through the same points; the stylus is upright.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    drag : float
        b [N s/m], positive.
    stiffness : float
        k [N/m]; a field without one does not keep the tip on a bend, and that is left out.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    times = np.asarray(curve.times)
    own, middles = np.diff(times), 0.5 * (times[1:] + times[:-1])
    speed = np.linalg.norm(curve.velocity(middles), axis=1)
    along, bending = inertia_along(curve, middles)
    longer = np.clip(bending / stiffness, -_LONGER, _LONGER) if stiffness > 0.0 else 0.0
    needed = drag * speed * (1.0 + longer) + friction_along(curve, middles) + along
    pulled = np.maximum(needed, 0.5 * drag * speed)
    # Where a curve rests it keeps its time.
    steps = own * np.divide(drag * speed, pulled, out=np.ones_like(own), where=pulled > 0.0)
    return Trajectory(times[0] + np.append(0.0, np.cumsum(steps)), curve.positions, periodic=curve.periodic)


def course_of(curve: Trajectory, drag: float, stiffness: float) -> Trajectory:
    """The curve along which a field leads that is to keep the pace of `curve`: paced, if its drag can be made up for.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    return paced(curve, drag, stiffness) if drag > 0.0 else curve
