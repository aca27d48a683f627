"""What a force field compiles to: rows of instructions over one array of parameters and one of memory.

A row of ``ops`` is ``[opcode, parameters at, memory at, curve at]``; the last is the offset of a packed
`Trajectory` in the parameters. Instructions leave wrenches on a stack, like a pocket calculator's, so that sums and
blends of fields are instructions too. The first `TRACE_SIZE` numbers of the memory tell of the last evaluation, for
the record: ``[t*, c (3), d, row, attractor, 0]``: phase, point and distance of the nearest curve, the row of its
law, and the phase of the point that attracts (t* itself, or the bunny's). With no curve near, d is infinite.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from controllers.curves.trajectory import Trajectory, curve_point
from controllers.errors import ParameterError
from controllers.state import Array, HandState, IntArray, Wrench

FOLLOW, BUNNY, EXTERNAL, ADD = range(4)
STACK = 16

TRACE_PHASE, TRACE_POINT, TRACE_DISTANCE, TRACE_ROW, TRACE_ATTRACTOR, TRACE_SIZE = 0, 1, 4, 5, 6, 8

Kernel = Callable[[Array, int, int, Array, int, Array, Array], None]


@njit
def leave_trace(params: Array, curve: int, memory: Array, phase: float, distance: float, attractor: float) -> None:
    """Note the closest point of a curve, if no nearer one is noted yet."""
    if distance < memory[TRACE_DISTANCE]:
        memory[TRACE_PHASE], memory[TRACE_DISTANCE], memory[TRACE_ATTRACTOR] = phase, distance, attractor
        memory[TRACE_POINT], memory[TRACE_POINT + 1], memory[TRACE_POINT + 2] = curve_point(params, curve, phase)


@dataclass(frozen=True, eq=False)
class Program:
    """Field of force in the form that the servo runs; fields add with ``+``.

    Parameters
    ----------
    ops : IntArray, shape (n, 4)
        Instructions, see the module.
    params : Array
        Gains and packed curves; never written.
    memory : Array
        Initial memory. Evaluation writes into a copy of it (`fresh_memory`), one copy for every run.

    Raises
    ------
    ParameterError
        If the instructions do not leave exactly one wrench, or need a stack deeper than `STACK`.
    """

    ops: IntArray
    params: Array
    memory: Array

    def __post_init__(self) -> None:
        depth = np.cumsum(np.where(self.ops[:, 0] == ADD, -1, 1))
        if len(depth) == 0 or depth[-1] != 1 or depth.min() < 1 or depth.max() > STACK:
            raise ParameterError(
                f"a field must leave one wrench and stack at most {STACK}; its instructions stack {depth.tolist()}"
            )

    @staticmethod
    def law(opcode: int, params: list[float], memory: list[float], curve: Trajectory | None = None) -> "Program":
        """One law of force: its opcode, parameters, initial memory and curve."""
        blob = np.zeros(0) if curve is None else curve.packed()
        trace = np.zeros(TRACE_SIZE)
        trace[TRACE_DISTANCE] = np.inf
        ops = np.array([[opcode, 0, TRACE_SIZE, len(params)]], dtype=np.int64)
        return Program(ops, np.concatenate([params, blob]), np.concatenate([trace, memory]))

    @staticmethod
    def external() -> "Program":
        """Wrench that Python writes into the memory at `external_slots` before each evaluation; zero until it does."""
        return Program.law(EXTERNAL, [], [0.0] * 6)

    def __add__(self, other: "Program") -> "Program":
        """Sum of two fields."""
        moved = other.ops.copy()
        moved[:, 1] += len(self.params)
        moved[:, 2] += len(self.memory) - TRACE_SIZE
        moved[:, 3] += len(self.params)
        ops = np.vstack([self.ops, moved, [[ADD, 0, 0, 0]]])
        memory = np.concatenate([self.memory, other.memory[TRACE_SIZE:]])
        return Program(ops, np.concatenate([self.params, other.params]), memory)

    @property
    def external_slots(self) -> IntArray:
        """Offsets in the memory of the wrenches [F (3), τ (3)] that Python fills in."""
        return self.ops[self.ops[:, 0] == EXTERNAL, 2]

    def fresh_memory(self) -> Array:
        """Memory for a new run."""
        return self.memory.copy()


def wrench_of(kernel: Kernel, program: Program, hand: HandState) -> Wrench:
    """Value of a program of one law at its first tick: the compiled law, called from Python."""
    wrench = np.zeros(6)
    _, params_at, memory_at, curve_at = (int(i) for i in program.ops[0])
    kernel(program.params, params_at, curve_at, program.fresh_memory(), memory_at, hand.vector(), wrench)
    return Wrench(wrench[:3], wrench[3:])


def checked(name: str, value: float, unit: str, least: float = 0.0, infinite: bool = False) -> float:
    """Gain or length that must be finite (or may be infinite) and not below `least`."""
    if np.isnan(value) or value < least or (np.isinf(value) and not infinite):
        raise ParameterError(
            f"{name} must be {'' if infinite else 'finite and '}at least {least:g} {unit}, got {value}"
        )
    return float(value)


def one_of(name: str, value: str, names: tuple[str, ...]) -> str:
    """Name that must be one of those known."""
    if value not in names:
        raise ParameterError(f"{name} must be one of {', '.join(names)}, got {value!r}")
    return value
