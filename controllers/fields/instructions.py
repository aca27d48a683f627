"""What a force field compiles to: rows of instructions over one array of parameters and one of memory.

A row of ``ops`` is ``[opcode, parameters at, memory at, curve at]``; the last is the offset of a packed
`Trajectory` in the parameters. Instructions leave wrenches on a stack, like a pocket calculator's, so that sums and
blends of fields are instructions too. The first `TRACE_SIZE` numbers of the memory tell of the last evaluation, for
the record: ``[t*, c (3), d, row, attractor, river]``: phase, point and distance of the nearest curve, the row of its
law, and the phase of the point that attracts (t* itself, or the bunny's). With no curve near, d is infinite. The
last is the number of the river that has the hand, in a field of higher order: −1 for none, and without such a field.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import checked
from controllers.curves.trajectory import Trajectory, curve_point
from controllers.errors import ParameterError
from controllers.fields.algebra import Weight
from controllers.state import Array, HandState, IntArray, Wrench

FOLLOW, BUNNY, EXTERNAL, ADD, HIGHER_ORDER, RECORDED, GATE, BLEND, LIMIT, STRETCHY = range(10)
LEADING, GOVERNOR, SOFT_WALL, ORIENTATION = 10, 11, 12, 13
STACK = 16

# What an instruction adds to the stack; a law adds its wrench.
_GROWTH = {ADD: -1, BLEND: -1, GATE: 0, LIMIT: 0}

TRACE_PHASE, TRACE_POINT, TRACE_DISTANCE, TRACE_ROW, TRACE_ATTRACTOR, TRACE_RIVER, TRACE_SIZE = 0, 1, 4, 5, 6, 7, 8

Kernel = Callable[[Array, int, int, Array, int, Array, Array], None]
PythonFunction = Callable[[HandState], npt.ArrayLike]
"""From the measured hand to the force F_H [N], called at every tick."""


@njit
def leave_trace(params: Array, curve: int, memory: Array, phase: float, distance: float, attractor: float) -> None:
    """Note the closest point of a curve, if no nearer one is noted yet."""
    if distance < memory[TRACE_DISTANCE]:
        memory[TRACE_PHASE], memory[TRACE_DISTANCE], memory[TRACE_ATTRACTOR] = phase, distance, attractor
        memory[TRACE_POINT], memory[TRACE_POINT + 1], memory[TRACE_POINT + 2] = curve_point(params, curve, phase)


@dataclass(frozen=True, eq=False)
class Program:
    r"""Field of force in the form that the servo runs, and the algebra of fields.

    .. math:: F + F', \quad x\,F, \quad s\,F, \quad (1 - s)\,F + s\,F', \quad F \min(1, L/|F|)

    by ``+``, ``*``, `gated`, `blended` and `limited`; each gives another program, and s is a `Weight`.

    Parameters
    ----------
    ops : IntArray, shape (n, 4)
        Instructions, see the module.
    params : Array
        Gains and packed curves; never written.
    memory : Array
        Initial memory. Evaluation writes into a copy of it (`fresh_memory`), one copy for every run.
    python_laws : tuple of PythonFunction
        What is to fill in the `external_slots`, one for each.

    Raises
    ------
    ParameterError
        If the instructions do not leave exactly one wrench, need a stack deeper than `STACK`, or the laws in Python
        are not as many as their slots.
    """

    ops: IntArray
    params: Array
    memory: Array
    python_laws: tuple[PythonFunction, ...] = ()

    def __post_init__(self) -> None:
        depth = np.cumsum([_GROWTH.get(int(opcode), 1) for opcode in self.ops[:, 0]])
        if len(depth) == 0 or depth[-1] != 1 or depth.min() < 1 or depth.max() > STACK:
            raise ParameterError(
                f"a field must leave one wrench and stack at most {STACK}; its instructions stack {depth.tolist()}"
            )
        if len(self.python_laws) != len(self.external_slots):
            raise ParameterError(
                f"a field needs one law in Python for each of its {len(self.external_slots)} external slots, "
                f"got {len(self.python_laws)}"
            )

    @staticmethod
    def law(
        opcode: int,
        params: Sequence[float] | Array,
        memory: Sequence[float],
        curve: Trajectory | None = None,
        python_laws: tuple[PythonFunction, ...] = (),
    ) -> "Program":
        """One law of force: its opcode, parameters, initial memory and curve."""
        blob = np.zeros(0) if curve is None else curve.packed()
        trace = np.zeros(TRACE_SIZE)
        trace[TRACE_DISTANCE], trace[TRACE_RIVER] = np.inf, -1.0
        ops = np.array([[opcode, 0, TRACE_SIZE, len(params)]], dtype=np.int64)
        return Program(ops, np.concatenate([params, blob]), np.concatenate([trace, memory]), python_laws)

    def _joined(self, other: "Program", opcode: int, params: Sequence[float] = ()) -> "Program":
        """Both programs one after the other, and an instruction that makes one wrench of theirs."""
        moved = other.ops.copy()
        moved[:, 1] += len(self.params)
        moved[:, 2] += len(self.memory) - TRACE_SIZE
        moved[:, 3] += len(self.params)
        at = len(self.params) + len(other.params)
        ops = np.vstack([self.ops, moved, [[opcode, at, 0, 0]]])
        memory = np.concatenate([self.memory, other.memory[TRACE_SIZE:]])
        laws = self.python_laws + other.python_laws
        return Program(ops, np.concatenate([self.params, other.params, params]), memory, laws)

    def _followed(self, opcode: int, params: Sequence[float]) -> "Program":
        """The program, and an instruction on its wrench."""
        ops = np.vstack([self.ops, [[opcode, len(self.params), 0, 0]]])
        return Program(ops, np.concatenate([self.params, params]), self.memory, self.python_laws)

    def __add__(self, other: "Program") -> "Program":
        """Sum of two fields."""
        return self._joined(other, ADD)

    def __rmul__(self, factor: float) -> "Program":
        """Field times a number."""
        return self.gated(Weight.constant(factor))

    def gated(self, weight: Weight) -> "Program":
        """Field times a weight: s F."""
        return self._followed(GATE, weight.row)

    def blended(self, other: "Program", weight: Weight) -> "Program":
        """Blend of two fields: (1 − s) F + s F'."""
        return self._joined(other, BLEND, weight.row)

    def limited(self, force: float, torque: float = np.inf) -> "Program":
        """Field whose force [N] and moment [N m] are cut to a length, their direction kept."""
        bounds = (("force", force, "N"), ("torque", torque, "N m"))
        return self._followed(LIMIT, [checked(*bound, infinite=True) for bound in bounds])

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
