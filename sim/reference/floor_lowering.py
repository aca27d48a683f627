r"""Lowering of the reference to the floor when the hand is slow, so that no figure hovers in the middle of a flight.

Gravity sets the duration of a flight phase. Played at σ times its pace it would need a gravity of σ² g, and a hand that
stops during a flight would demand a figure that hangs in the air. So the reference is lowered by a fraction s of its
feet's clearance c; s is 1 for a slow hand and 0 at the clips' own pace:

.. math:: z \leftarrow z - s\,u\,S(c), \qquad s \to S_{01}\Bigl(\frac{\sigma_1 - \sigma}{\sigma_1 - \sigma_0}\Bigr),
          \qquad \sigma = |\dot\theta|\,T_c / 2\pi,

with θ the stylus's angle about the vertical axis of H, which is the phase of these maps, T_c the duration of the clips,
S_01 the cubic step, S(x) = x³/(x² + r²) for x > 0, and u = S_01(2 cos β) the uprightness of the figure, with β the
root's tilt: 1 up to 60° and 0 from 90° on, since a figure that is upside down cannot be put on its feet. s follows its
goal with critical damping. Pose and velocity are continuous; acceleration is, too, except where the tilt passes 60° or
90°.
"""

import math

import numpy as np
from numba import njit, types

from controllers.legs.floor import SOFTNESS
from controllers.legs.footsteps import lever, limb_end
from controllers.legs.limbs import LIMB_SIZE
from geometry.arrays import Array
from geometry.easing import cubic_step
from models.humanoid.skeleton import CONTACT_RADIUS
from sim.compilation.compiled import entry_point
from sim.compilation.units import Unit

_NO_FLIGHT_PACE, _FULL_FLIGHT_PACE = 0.7, 0.9  # σ₀, σ₁: lowered fully below (0.49 g), not at all above (0.81 g)
_APPROACH_RATE = 10.0  # [1/s] natural frequency of the approach to the goal; a free fall from a jump takes 0.3 s
_ONSET_LENGTH = 4e-3  # r [m], smooths the onset of S


@njit
def lowering_goal(p: Array, v: Array, seconds: float) -> float:
    """Goal of the share s, for a stylus at p [m] with velocity v [m/s] in H and clips that last `seconds`."""
    square = p[0] * p[0] + p[1] * p[1]
    if square == 0.0:
        return 1.0
    pace = abs(p[0] * v[1] - p[1] * v[0]) / square * seconds / (2.0 * math.pi)
    return cubic_step((_FULL_FLIGHT_PACE - pace) / (_FULL_FLIGHT_PACE - _NO_FLIGHT_PACE))


@njit
def approach(state: Array, goal: float, period: float) -> None:
    """Advance the share with its two derivatives, `state` (3,), by one period towards its goal."""
    state[0] += period * state[1] + 0.5 * period**2 * state[2]
    state[1] += period * state[2]
    state[2] = _APPROACH_RATE**2 * (goal - state[0]) - 2.0 * _APPROACH_RATE * state[1]


@njit
def _height(limb: Array, end: Array, k: int, size: float) -> float:
    """Height over the floor [m] of the contact sphere in column k of a limb's row, its end being at `end` (7,)."""
    return end[2] + lever(limb, k, end)[2] - size * CONTACT_RADIUS


@njit
def clearance(limbs: Array, ends: Array, pose: Array, size: float) -> float:
    """Height over the floor of the lowest point of all soles [m], by a soft minimum; `ends` (n, 7) is scratch.

    With eight points at one height it is 4 mm lower (ln 8 of `SOFTNESS`). `size`: lengths over the default figure's.
    """
    lowest = math.inf
    for n in range(limbs.shape[0]):
        limb_end(limbs[n], pose, ends[n])
        for k in range(LIMB_SIZE, limbs.shape[1], 3):
            lowest = min(lowest, _height(limbs[n], ends[n], k, size))
    total = 0.0
    for n in range(limbs.shape[0]):
        for k in range(LIMB_SIZE, limbs.shape[1], 3):
            total += math.exp((lowest - _height(limbs[n], ends[n], k, size)) / SOFTNESS)
    return lowest - SOFTNESS * math.log(total)


@njit
def lower_to_floor(limbs: Array, ends: Array, share: float, pose: Array, size: float) -> None:
    """Lower a pose (75,) by a share of its feet's clearance; `limbs` are `packed_steppers`, `ends` (n, 7) scratch.

    `size`: lengths of the figure over the default's [1].
    """
    if share <= 0.0 or limbs.shape[0] == 0:
        return
    height = clearance(limbs, ends, pose, size)
    upright = 1.0 - 2.0 * (pose[4] ** 2 + pose[5] ** 2)
    if height > 0.0:
        pose[2] -= min(share, 1.0) * cubic_step(2.0 * upright) * height**3 / (height**2 + _ONSET_LENGTH**2)


@entry_point
def lower_start(limbs: Array, pose: Array, size: float) -> None:
    """Lower the initial pose (75,) of a run fully to the floor; see `lower_to_floor`."""
    lower_to_floor(limbs, np.empty((limbs.shape[0], 7)), 1.0, pose, size)


def lower_start_unit() -> Unit:
    """The compilation unit of `lower_start`."""
    return Unit.of(lower_start, types.Array(types.float64, 2, "C"), types.Array(types.float64, 1, "C"), types.float64)
