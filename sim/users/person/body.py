r"""A person's arm at the stylus: a mass on the spring of the arm, coupled to the stylus by the spring of the fingers.

.. math:: M \ddot x_h = K (x_d - x_h) + B (\dot x_d - \dot x_h) + u - F, \qquad
          F = k_g (x_h - p) + b_g (\dot x_h - \dot p)

with an ellipsoid for each of M, K, B (Hogan 1985, Mussa-Ivaldi et al. 1985), x_h the hand's position, x_d the intended
one, u the other muscle forces and F the force on the stylus. Masses, springs and dampers are connected as in the
five-parameter model of Speich, Shao & Goldfarb 2005, which was identified for a hand on a stylus. The mass is a body of
its own, not added to the linkage, because its inertia depends on direction and the fingers' coupling is compliant.
"""

import math

import numpy as np

from geometry.arrays import Array
from models.phantom.parameters import MIN_TIP_MASS
from sim.errors import SimError
from sim.users.person.person import Person

REFERENCE_GRIP = 2.0  # [N] grip force at which impedances are given: the middle of Fu & Cavusoglu 2012
_STIFF_AXIS = np.deg2rad(40.0)  # [rad] from straight ahead towards the midline: the line from shoulder to hand
_VERTICAL_STIFFNESS_RATIO = 0.6  # vertical over largest stiffness (m): between the axes of the horizontal ellipse


def arm_matrices(person: Person) -> tuple[Array, Array, Array]:
    """Inertia [kg], stiffness [N/m] and damping [N s/m] of the arm at its reference grip, in H, shape (3, 3) each."""
    angle = _STIFF_AXIS if person.hand == "right" else -_STIFF_AXIS
    axes = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0, 0, 1.0]])
    stiff = person.stiffness * np.array([1.0, 1.0 / person.anisotropy, _VERTICAL_STIFFNESS_RATIO])
    heavy = person.mass * np.array([math.sqrt(person.anisotropy), 1.0, 1.0])
    damping = 2.0 * person.damping_ratio * np.sqrt(stiff * heavy)
    inertia, stiffness, damper = (axes @ np.diag(values) @ axes.T for values in (heavy, stiff, damping))
    return inertia, stiffness, damper


def check_steps(person: Person, physics_step: float) -> None:
    """Check that the physics step is short enough for a person and that her delayed reflexes keep the arm stable.

    The fingers' force is held for a step h, so b_g h < m and k_g h² < m is required with the lightest apparent mass m
    of the tip. A spring k with a delay T has the damping −k T at low frequency, which the arm's damping must exceed.

    Raises
    ------
    SimError
        If either condition is violated.
    """
    stiffening = 1.0 + person.stiffening * max(10.0 - REFERENCE_GRIP, 0.0)
    max_step = min(MIN_TIP_MASS / (stiffening * person.grip_damping),
               math.sqrt(MIN_TIP_MASS / (stiffening * person.grip_stiffness)))  # fmt: skip
    if physics_step > max_step:
        raise SimError(
            f"the fingers of person {person.name!r} need a physics step of {max_step:.2g} s or less, "
            f"got {physics_step:g} s; choose a smaller --physics-step, or a softer grip"
        )
    _, stiffness, damping = arm_matrices(person)
    damping_margin = np.linalg.eigvalsh((1.0 - person.reflex_gain) * damping
                               - person.reflex_gain * person.reflex_delay * stiffness)  # fmt: skip
    if damping_margin[0] <= 0.0:
        raise SimError(
            f"the reflexes of person {person.name!r} make the arm oscillate: reflex_gain {person.reflex_gain:g} with "
            f"reflex_delay {person.reflex_delay:g} s; expected less of either, or more damping"
        )
