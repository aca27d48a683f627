"""Force laws in plain Python, usable wherever a compiled law is."""

from dataclasses import dataclass

from numba import njit

from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.fields.algebra.law import Program, PythonFeed
from controllers.fields.own.function_law import FunctionLaw
from geometry.arrays import Array


@njit
def given_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `PythonLaw`: memory [F (3), τ (3)], which Python has written there."""
    for i in range(6):
        wrench[i] = memory[slot + i]


@dataclass(frozen=True, eq=False, repr=False)
class PythonLaw(FunctionLaw):
    """Field computed by a Python function at every tick of the servo.

    It composes like any other law: the loop calls the function between sensing and the compiled rest of the tick. State
    that the function keeps between ticks is not part of the field's memory. Parameters are those of `FunctionLaw`.
    """

    def _compose(self) -> Program:
        feed = PythonFeed(TRACE_SIZE, self.six_numbers)
        return Program.of(self, given_wrench, [], [0.0] * 6, feeds=(feed,))
