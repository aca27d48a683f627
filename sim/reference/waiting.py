"""When a change of clip may begin: not while the figure takes off or flies.

If a transition began during a leap, the landing of the old motion, which catches its rise, would be missing. So a
change waits until the figure stands and the new motion has no flight within the transition, for at most a second.
"""

from numba import njit

from controllers.state import Array
from sim.reference.settling import clearance
from sim.reference.transition import DWELL, Transition

_FEET_DOWN = 0.01  # [m] clearance of the feet below which the figure stands
_FEET_UP = 0.05  # [m] clearance of the feet above which it is in a leap
_RISES = 0.6  # [m/s] vertical speed of the root from which the figure is about to take off: enough to rise by 2 cm
_PATIENCE = 1.0  # [s] for which a change waits at most


@njit
def stands(transition: Transition, pose: Array, rise: float, size: float) -> bool:
    """Whether a figure of a size stands and is not about to take off, with the vertical speed of its root [m/s]."""
    return clearance(transition.limbs, transition.ends, pose, size) < _FEET_DOWN and rise < _RISES


@njit
def leaps(transition: Transition, pose: Array, size: float) -> bool:
    """Whether a pose of a figure of a size is in the middle of a flight, where no new motion may begin."""
    return clearance(transition.limbs, transition.ends, pose, size) > _FEET_UP


@njit
def waits_no_longer(transition: Transition) -> bool:
    """Whether the river that would take over has waited long enough; without legs or blend time there is no wait."""
    return transition.rival[1] > DWELL + _PATIENCE or transition.seconds == 0.0 or transition.limbs.shape[0] == 0
