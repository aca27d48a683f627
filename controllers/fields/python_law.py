"""A law of force in plain Python, wherever a compiled one can stand."""

from dataclasses import dataclass

import numpy as np

from controllers.fields.instructions import EXTERNAL, Program, PythonFunction
from controllers.state import HandState, Wrench


@dataclass(frozen=True, eq=False)
class PythonLaw:
    """Field F(hand) computed by a Python function at every tick of the servo.

    It composes like any other (``Program`` and its algebra): the loop calls the function between sensing and the
    compiled rest of the tick, and hands its force to the instruction EXTERNAL.

    Parameters
    ----------
    function : callable
        From the measured `HandState` to the force F_H [N], three numbers. What it keeps between ticks is its own
        affair.
    """

    function: PythonFunction

    def program(self) -> Program:
        """Compiled form of the field: a slot for the function's force."""
        return Program.law(EXTERNAL, [], [0.0] * 6, python_laws=(self.function,))

    def wrench(self, hand: HandState) -> Wrench:
        """Force at one hand state; calls the function."""
        return Wrench(np.asarray(self.function(hand), dtype=float), np.zeros(3))
