r"""The pace of a hand that a field leads: what the Phantom takes off it, and a curve that makes up for that.

A field that draws a hand along with b (φ̇ − ṗ) leaves it behind by what the device holds: where the tip goes at v along
a curve and the joints at q̇, b (φ̇ − v) v is the power of friction, Σ_k (f_k |q̇_k| + d_k q̇_k²) with Coulomb's f and the
viscous d of `models.phantom`, and of what changes the kinetic energy T = ½ q̇ᵀ M q̇ of the linkage, whose M depends on
where it is. A flight of a clip that is played at nine tenths of its speed asks for eight tenths of gravity, and one
whose pace changes by a hundredth lands a centimetre from where its figure flew.
"""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.state import Array
from models.phantom.dynamics import mass_matrix
from models.phantom.kinematics import jacobian, vector_to_device_frame
from models.phantom.parameters import PREMIUM_1_5
from sim.world.world import phantom_angles

_STEP = 1e-3  # [s] to both sides, of the derivative of the kinetic energy


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


def inertia_along(curve: Trajectory, phases: Array) -> Array:
    """Force [N] along a curve that keeps the linkage at the curve's own pace, Ṫ/v, at phases (n,) [s]; 0 at rest.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    speed = np.linalg.norm(curve.velocity(phases), axis=1)
    first, last = (-np.inf, np.inf) if curve.periodic else (curve.start, curve.end)
    ahead, behind = np.minimum(phases + _STEP, last), np.maximum(phases - _STEP, first)
    power = (_kinetic_energy(curve, ahead) - _kinetic_energy(curve, behind)) / (ahead - behind)
    return np.divide(power, speed, out=np.zeros(len(phases)), where=speed > 0.0)


def _kinetic_energy(curve: Trajectory, phases: Array) -> Array:
    energy = np.zeros(len(phases))
    for k, (p, v) in enumerate(zip(curve.point(phases), curve.velocity(phases), strict=True)):
        theta = phantom_angles(p)
        rates = np.linalg.solve(jacobian.py_func(theta), vector_to_device_frame.py_func(tuple(v)))
        energy[k] = 0.5 * rates @ np.array(mass_matrix.py_func(theta)) @ rates
    return energy


def paced(curve: Trajectory, drag: float) -> Trajectory:
    r"""A curve in the same place, timed so that a field of drag b leads the Phantom along it at the old pace.

    .. math:: |\dot\varphi'| = |\dot\varphi| + f/b, \qquad dt' = dt\,/\,(1 + f/(b\,|\dot\varphi|))

    with f of `friction_along` and `inertia_along`. Where what the linkage gives back would ask for less than half of
    the old speed, it is half of it. The curve goes through the same points; the stylus is upright.

    Parameters
    ----------
    curve : Trajectory
        φ, in the hand frame H.
    drag : float
        b [N s/m], positive.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    times = np.asarray(curve.times)
    own, middles = np.diff(times), 0.5 * (times[1:] + times[:-1])
    speed = np.linalg.norm(curve.velocity(middles), axis=1)
    needed = drag * speed + friction_along(curve, middles) + inertia_along(curve, middles)
    pulled = np.maximum(needed, 0.5 * drag * speed)
    # Where a curve rests it keeps its time.
    steps = own * np.divide(drag * speed, pulled, out=np.ones_like(own), where=pulled > 0.0)
    return Trajectory(times[0] + np.append(0.0, np.cumsum(steps)), curve.positions, periodic=curve.periodic)


def course_of(curve: Trajectory, drag: float) -> Trajectory:
    """The curve along which a field leads that is to keep the pace of `curve`: paced, if its drag can be made up for.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    return paced(curve, drag) if drag > 0.0 else curve
