"""When a change of clip begins: a figure that takes off lands before it does something else.

A leap that goes over into another motion ends in the air: what the old motion rises by is no longer caught by its own
landing. So a change waits for a figure that stands, and for a new motion that does not leap before it is shown.
"""

from numba import njit

from controllers.state import Array
from sim.reference.settling import clearance
from sim.reference.transition import DWELL, Transition

_STANDS, _LEAPS = 0.01, 0.05  # [m] over the floor: from there a figure flies; and does so for long
_RISES = 0.6  # [m/s] of the root: faster, it is about to take off
_PATIENCE = 1.0  # [s] for which a change waits at most


@njit
def stands(transition: Transition, pose: Array, rise: float) -> bool:
    """Whether a figure is on the floor and does not take off, its root rising so fast [m/s]: it can change over."""
    return clearance(transition.limbs, transition.ends, pose) < _STANDS and rise < _RISES


@njit
def leaps(transition: Transition, pose: Array) -> bool:
    """Whether a pose is one of a flight, in the middle of which no motion can begin."""
    return clearance(transition.limbs, transition.ends, pose) > _LEAPS


@njit
def waits_no_longer(transition: Transition) -> bool:
    """Whether a river that would take over has waited long enough; without legs, or where it jumps, none waits."""
    return transition.rival[1] > DWELL + _PATIENCE or transition.seconds == 0.0 or transition.limbs.shape[0] == 0
