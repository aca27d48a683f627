r"""Energy tank (passivity layer): bounds the energy that a field injects, by a store refilled at a power P.

.. math:: \dot e = P - F \cdot v, \qquad e(0) = e_0, \quad e \le e_{max}, \qquad
          F \cdot v \le \frac{\max(e, 0)}{\tau} + P

The energy certificate gives the P that a river needs to run freely (b_d |φ̇|²/4 plus friction losses); the tank
enforces this bound if something differs from what was certified: a late loop, a user-defined law, a wrong gain. The
energy that the hand gets is at most e₀ + P (t + τ), up to the change of speed within one period. That work is booked
once measured: if it overdraws the store, all forces are reduced, F ← F ⟨1 + e/(P τ)⟩ for e < 0. Work that the hand does
on a spring can be returned, since it raises e, up to e_max, which is the most that the springs store.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from controllers.checks import check_field_types, check_positive
from controllers.errors import ParameterError
from geometry.arrays import Array

_POWER, _CAPACITY, _DRAIN, _PERIOD = range(4)
TANK_ENERGY, TANK_SCALE, TANK_POSITION, TANK_FORCE, TANK_STARTED, TANK_SIZE = 0, 1, 2, 5, 8, 9


@njit
def limit_power(params: Array, tank: Array, p: Array, v: Array, force: Array) -> None:
    """Book the work of the last period, and scale a force down to the power that the store allows.

    Parameters
    ----------
    params : Array
        `EnergyTank.params`.
    tank : Array
        Memory [e, scale of this tick, last p (3), last force (3), started], written. The store changes only by work
        done, work returned and refilling; what exceeds its capacity is lost.
    p, v : Array
        Measured position [m] and velocity [m/s] of the tip in H, shape (3,).
    force : Array
        [N], scaled in place, shape (3,). A force that takes energy from the hand, or acts on a hand at rest, is left
        unchanged unless the store is overdrawn: since velocity is measured with a delay, it may in fact inject energy.
    """
    period = params[_PERIOD]
    if tank[TANK_STARTED] > 0.0:
        work = 0.0
        for i in range(3):
            work += tank[TANK_FORCE + i] * (p[i] - tank[TANK_POSITION + i])
        tank[TANK_ENERGY] = min(params[_CAPACITY], tank[TANK_ENERGY] - work + params[_POWER] * period)
    tank[TANK_STARTED] = 1.0
    power = force[0] * v[0] + force[1] * v[1] + force[2] * v[2]
    allowed = max(tank[TANK_ENERGY], 0.0) * params[_DRAIN] + params[_POWER]
    # Divides only by the larger of two powers, which is positive, never by a speed.
    scale = allowed / power if power > allowed else 1.0
    if tank[TANK_ENERGY] < 0.0:
        scale *= max(0.0, 1.0 + tank[TANK_ENERGY] * params[_DRAIN] / params[_POWER])
    tank[TANK_SCALE] = scale
    for i in range(3):
        force[i] *= scale
        tank[TANK_FORCE + i], tank[TANK_POSITION + i] = force[i], p[i]


@njit
def book_force(tank: Array, force: Array) -> None:
    """Store the force (3,) [N] that the hand actually gets, after limits that follow the tank's."""
    for i in range(3):
        tank[TANK_FORCE + i] = force[i]


def reset_tank(tank: Array) -> None:
    """Make a memory usable after a fault: a non-finite energy is set to zero."""
    if not np.isfinite(tank[TANK_ENERGY]):
        tank[TANK_ENERGY] = 0.0
    tank[TANK_SCALE], tank[TANK_STARTED] = 1.0, 0.0
    tank[TANK_POSITION:TANK_STARTED] = 0.0


@dataclass(frozen=True)
class EnergyTank:
    """Budget of the energy that a field may inject.

    Parameters
    ----------
    period : float
        Servo period T [s].
    power : float
        P, constant refilling power [W].
    capacity : float
        e_max [J].
    drain_time : float
        τ, time constant of draining [s]; at least 2 T, so that one period cannot take more than the tank contains.
    initial : float, optional
        e₀, initial energy [J]; by default the tank is full.

    Raises
    ------
    ParameterError
        If a number is not positive and finite, e₀ above e_max, or τ below 2 T.
    """

    period: float
    power: float
    capacity: float
    drain_time: float = 0.05
    initial: float | None = None

    def __post_init__(self) -> None:
        check_field_types(self)
        check_positive("the energy tank", self, "period", "power", "capacity", "drain_time")
        if self.initial is not None:
            check_positive("the energy tank", self, "initial")
            if self.initial > self.capacity:
                raise ParameterError(f"an energy tank of {self.capacity} J cannot hold {self.initial} J at first")
        if self.drain_time < 2.0 * self.period:
            raise ParameterError(
                f"a tank that empties in {self.drain_time} s needs a period of at most {0.5 * self.drain_time} s, "
                f"got {self.period} s"
            )

    def params(self) -> Array:
        """Parameters of `limit_power`."""
        return np.array([self.power, self.capacity, 1.0 / self.drain_time, self.period])

    def fresh_memory(self) -> Array:
        """Memory of a tank at the start of a run."""
        memory = np.zeros(TANK_SIZE)
        memory[TANK_ENERGY], memory[TANK_SCALE] = self.capacity if self.initial is None else self.initial, 1.0
        return memory


def river_power(b_d: float, pace: float) -> float:
    """Largest power [W] that the damper of a river injects, b_d (φ̇ − v)·v ≤ b_d |φ̇|²/4, at |φ̇| ≤ pace [m/s]."""
    return 0.25 * b_d * pace**2


def spring_store(stiffness: float, distance: float, force: float = np.inf) -> float:
    r"""Energy [J] of a spring stretched by a distance R [m] whose force saturates at F [N].

    .. math:: \int_0^R \min(k s, F)\,ds
    """
    if stiffness * distance <= force:
        return 0.5 * stiffness * distance**2
    return force * (distance - 0.5 * force / stiffness)
