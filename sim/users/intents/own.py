"""An intent of the caller's own: a function that says what a person wants, from what she knows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit
from numba.core.errors import NumbaError

from controllers.curves.trajectory import Trajectory
from controllers.kernel_call import address_of
from sim.errors import SimError
from sim.users.own_intent import INTENT_ARGUMENTS
from sim.users.person_state import BELIEF, FELT_FORCE, PersonState
from sim.users.wishes import ENGAGED, FORCE, GRIP, OWN, PLACE, SWITCH, Wishes, resting


class Wish(NamedTuple):
    """What a person wants now.

    Attributes
    ----------
    place : sequence of float, optional
        Where the stylus should be, in H [m]; None: she lets it go where it goes.
    velocity : sequence of float
        At which that place moves [m/s]: she plans ahead by it.
    force : sequence of float
        That she exerts besides, in H [N].
    grip : float
        [N]; NaN for her own.
    switch : bool
        Whether she presses it.
    """

    place: npt.ArrayLike | None
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0)
    force: npt.ArrayLike = (0.0, 0.0, 0.0)
    grip: float = float("nan")
    switch: bool = False


@dataclass(frozen=True)
class Own:
    """What a function says: in Python, asked now and then, or compiled, asked at every servo tick.

    Parameters
    ----------
    function : callable
        In Python ``function(t, place, force)`` gives a `Wish`, or a place [m]. Compiled, ``function(t, place, force,
        rows)`` writes the wishes' two rows (see `sim.users.own_intent`). Either is told the time [s], where she
        believes her hand is [m] and the force of her hand that she feels [N], in H, shape (3,).
    every : float
        Time between two questions in Python [s].
    compiled : bool
        Whether the function is compiled by numba.

    Raises
    ------
    SimError
        If the time is not positive, or the function cannot be compiled.
    """

    function: Callable[..., Any]
    every: float = 0.05
    compiled: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.every) and self.every > 0.0):
            raise SimError(f"an intent that is asked every {self.every} s; expected more than 0 s")

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        return Wishes(resting(2), OWN)

    def address(self) -> int:
        """Where its code is, compiled for this process; 0 of one in Python.

        Raises
        ------
        SimError
            If it cannot be compiled.
        """
        if not self.compiled:
            return 0
        kernel: Any = njit(getattr(self.function, "py_func", self.function))
        try:
            return address_of(kernel, INTENT_ARGUMENTS)
        except NumbaError as error:
            first = str(error).strip().splitlines()[0]
            raise SimError(f"the intent {self.function.__name__} cannot be compiled: {first}") from None

    def ask(self, person: PersonState, t: float) -> None:
        """Ask the function in Python what a person wants at a time [s].

        Raises
        ------
        SimError
            If it gives something else.
        """
        said = self.function(t, person.vectors[BELIEF].copy(), person.vectors[FELT_FORCE].copy())
        try:
            wish = said if isinstance(said, Wish) else Wish(said)
            rows = resting(2)
            if wish.place is not None:
                rows[0, PLACE : PLACE + 3], rows[0, ENGAGED] = wish.place, 1.0
            rows[0, FORCE : FORCE + 3], rows[1, PLACE : PLACE + 3] = wish.force, wish.velocity
            rows[0, GRIP], rows[0, SWITCH] = wish.grip, float(wish.switch)
            person.wishes[:] = Wishes(rows, OWN).rows
        except (TypeError, ValueError):
            name = getattr(self.function, "__name__", "function")
            raise SimError(f"the intent {name} gave {said!r}; expected a place of three numbers, or a Wish") from None
