"""Weights, and the operations on wrenches that use them: gate, blend, limit. With the sum: the algebra of fields."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import check_field_types, check_kind, checked, numbers_of
from controllers.errors import ParameterError
from controllers.safety.limiter import magnitude
from controllers.state import HAND_POSITION, HAND_SWITCH, HAND_VELOCITY
from geometry.arrays import Array
from geometry.easing import smooth_step

_MIN_RADIUS = 1e-9  # [m] smallest radius of a ball; a smaller one would never contain a hand
_CONSTANT, _BALL, _SPEED, _SWITCH = range(4)
_KIND, _COMPLEMENT, _NUMBERS, WEIGHT_SIZE = 0, 1, 2, 6  # layout of a weight's row: kind, flag for 1 − s, four numbers


@njit
def window(s2: float) -> float:
    r"""Window w = (1 − s²)³ inside the tube and 0 outside, as a function of s² = (d/ε)².

    It fades a river out at its tube's edge (Donald & Henle 2000, section 2.3), C² everywhere: zero slope at the centre;
    value, slope and curvature vanish at the edge. The argument s² avoids the square root, so w is smooth at d = 0 too;
    ε = ∞ gives s² = 0, a river that fills the space.
    """
    inside = np.maximum(0.0, 1.0 - s2)
    return inside * inside * inside


@njit
def weight_of(params: Array, at: int, hand: Array) -> float:
    """Weight s of the row at ``params[at:]`` for a hand (see `Weight`)."""
    kind = params[at + _KIND]
    s = params[at + _NUMBERS]
    if kind == _BALL:
        square = 0.0
        for i in range(3):
            square += (hand[HAND_POSITION + i] - params[at + _NUMBERS + i]) ** 2
        s = window(square * params[at + _NUMBERS + 3])
    elif kind == _SPEED:
        square = 0.0
        for i in range(3):
            square += hand[HAND_VELOCITY + i] ** 2
        s = smooth_step((np.sqrt(square) - params[at + _NUMBERS]) * params[at + _NUMBERS + 1])
    elif kind == _SWITCH:
        s = hand[HAND_SWITCH]
    return 1.0 - s if params[at + _COMPLEMENT] != 0.0 else s


@njit
def gate(params: Array, at: int, hand: Array, wrench: Array) -> None:
    """Instruction GATE: F ← s F."""
    s = weight_of(params, at, hand)
    for i in range(6):
        wrench[i] *= s


@njit
def blend(params: Array, at: int, hand: Array, wrench: Array, other: Array) -> None:
    """Instruction BLEND: F ← (1 − s) F + s F', with F' the wrench above F on the stack."""
    s = weight_of(params, at, hand)
    for i in range(6):
        wrench[i] = (1.0 - s) * wrench[i] + s * other[i]


@njit
def limit(params: Array, at: int, wrench: Array) -> None:
    """Instruction LIMIT: F ← F min(1, L/|F|), and the moment likewise; parameters [L of the force, L of the moment]."""
    for part in range(2):
        norm = magnitude(wrench[3 * part], wrench[3 * part + 1], wrench[3 * part + 2])
        if norm > params[at + part]:
            for i in range(3):
                wrench[3 * part + i] *= params[at + part] / norm


@dataclass(frozen=True)
class Weight:
    """Number s between 0 and 1 that depends on the hand, for `Program.gated` and `Program.blended`; ``~s`` is 1 − s.

    Made by `constant`, `ball`, `speed` and `switch`. All but the switch are C² in the state of the hand; at the
    switch a field jumps.

    Raises
    ------
    ParameterError
        If a number is not finite, or the row is not one that these make: compiled code reads it unchecked.
    """

    row: tuple[float, ...]

    def __post_init__(self) -> None:
        check_field_types(self)
        if not np.isfinite(self.row).all():
            raise ParameterError(f"numbers of a weight must be finite, got {self.row}")
        if len(self.row) != WEIGHT_SIZE or self.row[_KIND] not in range(4):
            raise ParameterError(f"row is {self.row}; expected a weight made by constant, ball, speed or switch")

    @staticmethod
    def constant(s: float) -> "Weight":
        """Constant weight: any finite number, so that it can also scale a field or reverse its sign."""
        check_kind("s", s, float)
        return _weight(_CONSTANT, s)

    @staticmethod
    def ball(centre: npt.ArrayLike, radius: float) -> "Weight":
        """Window w(|p − c|/r) about a centre c in H [m]: 1 at the centre, 0 from the radius r [m] on."""
        place = numbers_of("centre", centre)
        if place.shape != (3,):
            raise ParameterError(f"the centre of a ball is {place.tolist()}; expected three numbers")
        return _weight(_BALL, *place.tolist(), checked("radius", radius, "m", _MIN_RADIUS, infinite=True) ** -2)

    @staticmethod
    def speed(low: float, high: float) -> "Weight":
        """0 up to the hand speed `low`, 1 from `high` on [m/s], with a smooth step between."""
        check_kind("low", low, float)
        check_kind("high", high, float)
        if not 0.0 <= low < high:
            raise ParameterError(f"speeds of a weight must be 0 ≤ low < high, got {low} and {high} m/s")
        return _weight(_SPEED, low, 1.0 / (high - low))

    @staticmethod
    def switch() -> "Weight":
        """1 while the stylus switch is pressed, else 0."""
        return _weight(_SWITCH)

    @property
    def factor(self) -> float | None:
        """The number of a constant weight; None of one that depends on the hand."""
        s = self.row[_NUMBERS]
        return (1.0 - s if self.row[_COMPLEMENT] else s) if self.row[_KIND] == _CONSTANT else None

    def __invert__(self) -> "Weight":
        return Weight((self.row[_KIND], 1.0 - self.row[_COMPLEMENT], *self.row[_NUMBERS:]))


def _weight(kind: int, *numbers: float) -> Weight:
    padding: Sequence[float] = [0.0] * (WEIGHT_SIZE - _NUMBERS - len(numbers))
    return Weight((float(kind), 0.0, *map(float, numbers), *padding))
