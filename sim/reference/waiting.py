"""When a change of clip may begin: not while the figure takes off or flies.

A transition that began during a leap would omit the landing of the old motion, which absorbs the leap. So a change
waits until the figure stands and the new motion has no flight within the transition, for at most a second.
"""

from numba import njit

from geometry.arrays import Array
from sim.reference.floor_lowering import clearance
from sim.reference.transition import DWELL_TIME, Transition

_STANDING_CLEARANCE = 0.01  # [m] clearance of the feet below which the figure stands
_LEAP_CLEARANCE = 0.05  # [m] clearance of the feet above which it is in a leap
_TAKE_OFF_SPEED = 0.6  # [m/s] vertical speed of the root above which the figure takes off: enough to rise by 2 cm
_MAX_WAIT_TIME = 1.0  # [s] longest wait of a change


@njit
def is_standing(transition: Transition, pose: Array, rise: float, size: float) -> bool:
    """Whether a figure stands and is not about to take off; `rise` is the vertical speed of its root [m/s]."""
    return clearance(transition.limbs, transition.ends, pose, size) < _STANDING_CLEARANCE and rise < _TAKE_OFF_SPEED


@njit
def is_leaping(transition: Transition, pose: Array, size: float) -> bool:
    """Whether a pose is in the middle of a flight, where no new motion may begin; `size` is that of the figure."""
    return clearance(transition.limbs, transition.ends, pose, size) > _LEAP_CLEARANCE


@njit
def has_waited_enough(transition: Transition) -> bool:
    """Whether the river that would take over has waited long enough; without legs or blend time there is no wait."""
    return (
        transition.candidate_river[1] > DWELL_TIME + _MAX_WAIT_TIME
        or transition.seconds == 0.0
        or transition.limbs.shape[0] == 0
    )
