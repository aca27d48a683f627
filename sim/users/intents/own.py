"""A user-defined intent: a function that computes a person's wish from what she perceives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit
from numba.core.errors import NumbaError

from controllers.checks import check_callable, check_field_types
from controllers.curves.trajectory import Trajectory
from controllers.kernel_call import address_of
from sim.errors import SimError
from sim.users.person.person_state import BELIEF, FELT_FORCE, PersonState
from sim.users.person.wishes import ENGAGED, FORCE, GRIP, INTENT_ARGUMENTS, OWN, PLACE, SWITCH, Wishes, resting


class Wish(NamedTuple):
    """What a person wants now.

    Attributes
    ----------
    place : sequence of float, optional
        Wanted position of the stylus in H [m]; None: she is passive.
    velocity : sequence of float
        Velocity of that position [m/s], with which she plans ahead.
    force : sequence of float
        Additional force that she exerts, in H [N].
    grip : float
        Grip force [N]; NaN for the person's own.
    switch : bool
        Whether she presses the switch.
    """

    place: npt.ArrayLike | None
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0)
    force: npt.ArrayLike = (0.0, 0.0, 0.0)
    grip: float = float("nan")
    switch: bool = False


@dataclass(frozen=True)
class Own:
    """An intent given by a function: in Python, called periodically, or compiled, called at every servo tick.

    Parameters
    ----------
    function : callable
        In Python ``function(t, place, force)`` returns a `Wish`, or a position [m]. Compiled, ``function(t, place,
        force, rows)`` writes the wishes' two rows (see `call_intent` in `sim.users.person.wishes`). Its arguments are
        the time [s], her estimate of her hand's position [m] and the force of her hand as she feels it [N], in H, shape
        (3,).
    every : float
        Time between two calls in Python [s].
    compiled : bool
        Whether the function is compiled by numba.

    Raises
    ------
    ParameterError
        If a value is of another kind, or the function takes other arguments.
    SimError
        If `every` is not positive and finite.
    """

    function: Callable[..., Any]
    every: float = 0.05
    compiled: bool = False

    def __post_init__(self) -> None:
        check_field_types(self)
        check_callable("function", self.function, "t", "place", "force", *(("rows",) if self.compiled else ()))
        if not (np.isfinite(self.every) and self.every > 0.0):
            raise SimError(f"an intent that is evaluated every {self.every} s; expected more than 0 s")

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        return Wishes(resting(2), OWN)

    def address(self) -> int:
        """Address of the function compiled for this process; 0 if it is in Python.

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
            first_line = str(error).strip().splitlines()[0]
            raise SimError(f"the intent {self.function.__name__} cannot be compiled: {first_line}") from None

    def ask(self, person: PersonState, t: float) -> None:
        """Call the function in Python at time t [s] and set the person's wishes from its result.

        Raises
        ------
        SimError
            If the result is neither a `Wish` nor a position.
        """
        result = self.function(t, person.vectors[BELIEF].copy(), person.vectors[FELT_FORCE].copy())
        try:
            wish = result if isinstance(result, Wish) else Wish(result)
            rows = resting(2)
            if wish.place is not None:
                rows[0, PLACE : PLACE + 3], rows[0, ENGAGED] = wish.place, 1.0
            rows[0, FORCE : FORCE + 3], rows[1, PLACE : PLACE + 3] = wish.force, wish.velocity
            rows[0, GRIP], rows[0, SWITCH] = wish.grip, float(wish.switch)
            person.wishes[:] = Wishes(rows, OWN).rows
        except (TypeError, ValueError):
            name = getattr(self.function, "__name__", "function")
            raise SimError(
                f"the intent {name} gave {result!r}; expected a position (three numbers) or a Wish"
            ) from None
