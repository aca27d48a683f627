r"""Energy tank: what a field may inject is a store that it drains and a power that fills it, kept at run time.

.. math:: \dot e = P - F \cdot v, \qquad e(0) = e_0, \quad e \le e_{max}, \qquad
          F \cdot v \le \frac{\max(e, 0)}{\tau} + P

The certificate of energy says what P has to be for a river to run freely (b_d |φ̇|²/4 and what friction takes); the tank
holds it to that when something is not as certified: a late loop, a user's own law, a wrong gain. So the energy that a
hand gets is at most e₀ + P (t + τ), up to what speeds change within one period, which is booked when it has been seen:
a store that is overdrawn by it lets all forces through only in part, F ← F ⟨1 + e/(P τ)⟩ for e < 0. What a hand puts
into a spring it may have back, for e rises above e₀ by it, up to e_max: the most that the springs hold.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from controllers.state import Array

_POWER, _CAPACITY, _DRAIN, _PERIOD = range(4)
TANK_ENERGY, TANK_SCALE, TANK_POSITION, TANK_FORCE, TANK_STARTED, TANK_SIZE = 0, 1, 2, 5, 8, 9


@njit
def guard_energy(params: Array, tank: Array, p: Array, v: Array, force: Array) -> None:
    """Book the work of the last period, and scale a force down to the power that the store allows.

    Parameters
    ----------
    params : Array
        `EnergyTank.params`.
    tank : Array
        Memory [e, scale of this tick, last p (3), last force (3), started], written. The store changes by flows only:
        work done, work taken back, filling; what does not fit into it is lost.
    p, v : Array
        Measured position [m] and velocity [m/s] of the tip in H, shape (3,).
    force : Array
        [N], scaled in place, shape (3,). A force that takes energy from the hand, or finds it at rest, is not touched
        unless the store is overdrawn: by what is measured late it may be giving.
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
    # A quotient of two powers, only where the divisor is the larger, positive one: no speed is divided by.
    scale = allowed / power if power > allowed else 1.0
    if tank[TANK_ENERGY] < 0.0:
        scale *= max(0.0, 1.0 + tank[TANK_ENERGY] * params[_DRAIN] / params[_POWER])
    tank[TANK_SCALE] = scale
    for i in range(3):
        force[i] *= scale
        tank[TANK_FORCE + i], tank[TANK_POSITION + i] = force[i], p[i]


@njit
def book_force(tank: Array, force: Array) -> None:
    """Tell the tank which force (3,) the hand really gets, where another limit came after the tank's."""
    for i in range(3):
        tank[TANK_FORCE + i] = force[i]


def renew_tank(tank: Array) -> None:
    """Make a memory usable after a fault: an energy that was lost is taken for none."""
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
        P, what flows in all the time [W].
    capacity : float
        e_max [J].
    drain_time : float
        τ, in which a full tank may be emptied [s]; at least 2 T, so that one period cannot take more than there is.
    initial : float, optional
        e₀, what the tank holds at first [J]; by default it is full.

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
        for name in ("period", "power", "capacity", "drain_time", "initial"):
            value = getattr(self, name)
            if name == "initial" and value is None:
                continue
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"{name} of the energy tank must be positive and finite, got {value}")
        if self.initial is not None and self.initial > self.capacity:
            raise ParameterError(f"an energy tank of {self.capacity} J cannot hold {self.initial} J at first")
        if self.drain_time < 2.0 * self.period:
            raise ParameterError(
                f"a tank that empties in {self.drain_time} s needs a period of at most {0.5 * self.drain_time} s, "
                f"got {self.period} s"
            )

    def params(self) -> Array:
        """Parameters of `guard_energy`."""
        return np.array([self.power, self.capacity, 1.0 / self.drain_time, self.period])

    def fresh_memory(self) -> Array:
        """Memory of a tank at the start of a run."""
        memory = np.zeros(TANK_SIZE)
        memory[TANK_ENERGY], memory[TANK_SCALE] = self.capacity if self.initial is None else self.initial, 1.0
        return memory


def river_power(b_d: float, pace: float) -> float:
    """Most power [W] that the damper of a river injects, b_d (φ̇ − v)·v ≤ b_d |φ̇|²/4, at |φ̇| ≤ pace [m/s]."""
    return 0.25 * b_d * pace**2


def spring_store(stiffness: float, distance: float, force: float = np.inf) -> float:
    r"""Most energy [J] that a spring holds up to a distance [m] when no more than a force [N] gets through.

    .. math:: \int_0^R \min(k s, F)\,ds
    """
    if stiffness * distance <= force:
        return 0.5 * stiffness * distance**2
    return force * (distance - 0.5 * force / stiffness)
