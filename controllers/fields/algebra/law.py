"""Force laws and their algebra: the interface shared by built-in, composed and user-defined fields."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from controllers.checks import check_kind, checked
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.description import parts_of
from controllers.fields.algebra.feed import Feed
from controllers.fields.algebra.instructions import (
    LAW_ARGUMENTS,
    OP_CODE,
    OP_MEMORY,
    OP_PARAMETERS,
    STACK,
    TRACE_SIZE,
    Join,
    Kernel,
    empty_trace,
)
from controllers.fields.algebra.program import Compiled, evaluate
from controllers.fields.algebra.walker_feed import Walkers, feed_walkers, fresh_walkers
from controllers.fields.algebra.weights import WEIGHT_SIZE, Weight
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT, HapticMap
from controllers.kernel_call import address_of
from controllers.state import HAND_POSITION, HAND_SIZE, HandState, Wrench
from controllers.walking.walking import Walking, follow_hand
from geometry.arrays import Array, IntArray


class Law(ABC):
    r"""A force field F(hand), and the algebra of fields.

    .. math:: F \pm F', \quad x\,F, \quad s\,F, \quad (1 - s)\,F + s\,F', \quad F \min(1, L/|F|)

    by ``+``, ``-``, ``*``, ``/``, `gated`, `blended` and `limited`; each result is again a law, and s is a `Weight`.
    """

    __array_ufunc__ = None  # an array times a field is refused, not an array of fields

    @abstractmethod
    def _compose(self) -> "Program":
        """The field as it is executed; called once, by `program`."""

    @cached_property
    def _program(self) -> "Program":
        return self._compose()

    def program(self) -> "Program":
        """Compiled form of the field, which the servo runs."""
        return self._program

    @property
    def curves(self) -> tuple[Trajectory, ...]:
        """Curves along which the field leads, in the order of its laws; empty for a law without a curve."""
        curve = getattr(self, "curve", None)
        return (curve,) if isinstance(curve, Trajectory) else ()

    def wrench(self, hand: HandState) -> Wrench:
        """Force and moment at one hand state, evaluated by the compiled laws as at the first tick of a run."""
        check_kind("hand", hand, HandState)
        if (size := len(hand.vector())) != HAND_SIZE:
            raise ParameterError(f"the hand has {size} numbers; expected {HAND_SIZE}, of t, p, q, v, w and switch")
        program, wrench = self.program(), np.empty(6)
        memory = program.fresh_memory()
        program.feed(memory, hand)
        evaluate(*program.compiled(), memory, hand.vector(), wrench)
        return Wrench(wrench[:3], wrench[3:])

    def description(self) -> dict[str, object]:
        """The law's name and its parameters by name, in plain data; a certificate of the law depends on these."""
        return {"law": type(self).__name__, "parameters": parts_of(self)}

    def __add__(self, other: "Law") -> "Program":
        """Sum of two fields."""
        check_kind("the other field", other, Law)
        first, second = self.program(), other.program()
        if second.depth == STACK > first.depth:  # evaluated second, it would overflow the stack
            first, second = second, first
        return first.joined(second, Join.ADD)

    def __radd__(self, other: float) -> "Program":
        """The field itself: a sum of fields by `sum` begins with 0."""
        if other != 0:
            raise ParameterError(f"a field was added to {other!r}; expected another field")
        return self.program()

    def __neg__(self) -> "Program":
        """Field in the opposite direction: −F."""
        return -1.0 * self

    def __sub__(self, other: "Law") -> "Program":
        """Difference of two fields."""
        check_kind("the other field", other, Law)
        return self + -other

    def __truediv__(self, divisor: float) -> "Program":
        """Field over a number."""
        check_kind("a divisor of a field", divisor, float)
        if divisor == 0:
            raise ParameterError("a field was divided by 0; expected another number")
        return self * (1.0 / divisor)

    def __rmul__(self, factor: float) -> "Program":
        """Field times a number."""
        return self.gated(Weight.constant(factor))

    __mul__ = __rmul__

    def gated(self, weight: Weight) -> "Program":
        """Field times a weight: s F."""
        check_kind("weight", weight, Weight)
        return self.program().followed(Join.GATE, weight.row)

    def blended(self, other: "Law", weight: Weight) -> "Program":
        """Blend of two fields: (1 − s) F + s F'."""
        check_kind("other", other, Law)
        check_kind("weight", weight, Weight)
        return self.program().joined(other.program(), Join.BLEND, weight.row)

    def limited(self, force: float, torque: float = np.inf) -> "Program":
        """Field whose force [N] and moment [N m] saturate at a norm; their direction is kept."""
        bounds = (("force", force, "N"), ("torque", torque, "N m"))
        return self.program().followed(Join.LIMIT, [checked(*bound, infinite=True) for bound in bounds])


class LawOffsets(NamedTuple):
    """Offsets of the numbers of a law in a program.

    Attributes
    ----------
    law : Law
    params, memory : int
        Offsets in the program's parameters and in its memory.
    """

    law: Law
    params: int
    memory: int


@dataclass(frozen=True, eq=False)
class Program(Law):
    """Force field in the form that the servo runs.

    Parameters
    ----------
    ops : IntArray, shape (n, 4)
        Instructions, see `controllers.fields.algebra.instructions`.
    params : Array
        Gains and packed curves; never written.
    memory : Array
        Initial memory. Evaluation writes into a copy of it (`fresh_memory`), one copy for every run.
    kernels : tuple of Kernel
        Compiled laws, each once; the code of a law's instruction is its kernel's index here.
    laws : tuple of Law
        Laws in the order of their instructions.
    feeds : tuple of Feed
        Inputs that are written into the memory before each evaluation, besides the hand.

    Raises
    ------
    ParameterError
        If the instructions do not leave exactly one wrench or need a stack deeper than `STACK`, or a law has no kernel.
    """

    ops: IntArray
    params: Array
    memory: Array
    kernels: tuple[Kernel, ...] = ()
    laws: tuple[Law, ...] = ()
    feeds: tuple[Feed, ...] = ()

    def __post_init__(self) -> None:
        codes, depth = self.ops[:, OP_CODE].tolist(), self._depths
        if len(depth) == 0 or depth[-1] != 1 or depth.min() < 1 or depth.max() > STACK:
            raise ParameterError(
                f"a field must leave one wrench and stack at most {STACK}; its instructions stack {depth.tolist()}"
            )
        laws = [code for code in codes if code >= 0]
        if max(laws) >= len(self.kernels) or len(laws) != len(self.laws):
            raise ParameterError(
                f"a field of {len(laws)} laws with the codes {laws} needs their kernels and names; "
                f"got {len(self.kernels)} kernels and {len(self.laws)} laws"
            )

    @cached_property
    def _depths(self) -> IntArray:
        """Pending wrenches after each instruction."""
        codes: list[int] = self.ops[:, OP_CODE].tolist()
        return np.cumsum([1 if code >= 0 else 1 - Join(code).takes for code in codes], dtype=np.int64)

    @property
    def depth(self) -> int:
        """Largest number of wrenches that are pending at once."""
        return int(self._depths.max())

    @property
    def curves(self) -> tuple[Trajectory, ...]:
        """Curves along which the laws lead, in their order."""
        return tuple(curve for law in self.laws for curve in law.curves)

    def __repr__(self) -> str:
        joins = [Join(code).name.lower() for code in self.ops[:, OP_CODE].tolist() if code < 0]
        return f"<field of {', '.join(map(repr, self.laws))}{', joined by ' * bool(joins)}{', '.join(joins)}>"

    @staticmethod
    def of(
        law: Law,
        kernel: Kernel,
        params: Sequence[float] | Array,
        memory: Sequence[float] | Array,
        curve: Trajectory | None = None,
        feeds: tuple[Feed, ...] = (),
    ) -> "Program":
        """Program of one law: its kernel, parameters, initial memory, curve, and the feeds written before each tick.

        The law's memory begins at `TRACE_SIZE`.
        """
        blob = np.zeros(0) if curve is None else curve.packed()
        ops = np.array([[0, 0, TRACE_SIZE, len(params)]], dtype=np.int64)
        numbers = np.concatenate([np.asarray(params, dtype=np.float64), blob])
        return Program(ops, numbers, np.concatenate([empty_trace(), memory]), (kernel,), (law,), feeds)

    def joined(self, other: "Program", join: Join, params: Sequence[float] = ()) -> "Program":
        """Both programs one after the other, then an operation that combines their two wrenches into one."""
        kernels = (*self.kernels, *(kernel for kernel in other.kernels if kernel not in self.kernels))
        params_shift, memory_shift = len(self.params), len(self.memory) - TRACE_SIZE
        shifted_ops = other.ops + np.array([0, params_shift, memory_shift, params_shift])
        laws = shifted_ops[:, OP_CODE] >= 0
        shifted_ops[laws, OP_CODE] = [kernels.index(other.kernels[code]) for code in shifted_ops[laws, OP_CODE]]
        return Program(
            np.vstack([self.ops, shifted_ops, [[join, params_shift + len(other.params), 0, 0]]]),
            np.concatenate([self.params, other.params, params]),
            np.concatenate([self.memory, other.memory[TRACE_SIZE:]]),
            kernels,
            self.laws + other.laws,
            self.feeds + tuple(feed.moved(params_shift, memory_shift) for feed in other.feeds),
        )

    def followed(self, join: Join, params: Sequence[float]) -> "Program":
        """The program, then an operation on its wrench."""
        ops = np.vstack([self.ops, [[join, len(self.params), 0, 0]]])
        return replace(self, ops=ops, params=np.concatenate([self.params, params]))

    def _compose(self) -> "Program":
        return self

    @cached_property
    def _compiled(self) -> Compiled:
        units = np.array([address_of(kernel, LAW_ARGUMENTS) for kernel in self.kernels], dtype=np.int64)
        return Compiled(units, self.ops, self.params)

    def compiled(self) -> Compiled:
        """First arguments of `evaluate`; laws that are not compiled yet are compiled in this process."""
        return self._compiled

    @property
    def python_feeds(self) -> tuple[tuple[Callable[[HandState], Array], int], ...]:
        """Functions that the loop calls at every tick, and the offset in the memory of the six numbers of each."""
        return tuple((source, slot) for source, slot, _ in self.feeds if not isinstance(source, HapticMap | Walking))

    @property
    def python_laws(self) -> tuple[Callable[[HandState], Array], ...]:
        """The functions of `python_feeds`."""
        return tuple(function for function, _ in self.python_feeds)

    def fresh_memory(self) -> Array:
        """Memory for a new run."""
        return self.memory.copy()

    def fresh_walkers(self) -> Walkers:
        """Walkers for a new run; their kernel is compiled in this process if it is not compiled yet."""
        walkers = fresh_walkers(self.feeds)
        return walkers.linked(address_of(follow_hand, LAW_ARGUMENTS)) if walkers.feeds.size else walkers

    def feed(self, memory: Array, hand: HandState) -> None:
        """Write the inputs of the feeds into the memory, from Python, as at the first tick of a run."""
        walkers = self.fresh_walkers()
        if walkers.feeds.size:
            feed_walkers(walkers, self.params, memory, hand.vector())
        for function, slot in self.python_feeds:
            memory[slot : slot + 6] = function(HandState.of(hand.vector()))
        stylus = hand.vector()[HAND_POSITION : HAND_POSITION + STYLUS]
        for haptic_map, slot, _ in self.feeds:
            if isinstance(haptic_map, HapticMap):
                first, last = slot + haptic_map.nq, slot + haptic_map.nq + haptic_map.nv * STYLUS_TANGENT
                map_memory = memory[last : last + len(haptic_map.compiled().memory)]
                memory[slot:first] = haptic_map.pose(stylus, map_memory)
                memory[first:last] = haptic_map.jacobian(stylus, map_memory).ravel()

    def places(self) -> tuple[LawOffsets, ...]:
        """Offsets of the laws' parameters and memory, in the order of their instructions."""
        rows = self.ops[self.ops[:, OP_CODE] >= 0].tolist()
        return tuple(
            LawOffsets(law, row[OP_PARAMETERS], row[OP_MEMORY]) for law, row in zip(self.laws, rows, strict=True)
        )

    def composition(self) -> Iterator[tuple[Law | Join, Array]]:
        """Laws and operations in postfix order, each with the operation's parameters (none for a law)."""
        laws = iter(self.laws)
        for code, at, *_ in self.ops.tolist():
            if code >= 0:
                yield next(laws), np.zeros(0)
            else:
                join = Join(code)
                yield join, self.params[at : at + {Join.ADD: 0, Join.LIMIT: 2}.get(join, WEIGHT_SIZE)]

    def with_law(self, law: Law, other: Law) -> "Program":
        """The same composition with `law` replaced by `other`."""
        stack: list[Program] = []
        for item, numbers in self.composition():
            if isinstance(item, Law):
                stack.append((other if item is law else item).program())
                continue
            last = stack.pop()
            stack.append(
                last.followed(item, list(numbers)) if item.takes == 1
                else stack.pop().joined(last, item, list(numbers))
            )  # fmt: skip
        return stack[0]

    def description(self) -> dict[str, object]:
        """Composition of the field: operations, and laws with their parameters by name."""
        stack: list[dict[str, object]] = []
        for item, numbers in self.composition():
            if isinstance(item, Law):
                stack.append(item.description())
                continue
            taken, stack = stack[len(stack) - item.takes :], stack[: len(stack) - item.takes]
            if item is Join.ADD and isinstance(summands := taken[0].get("add"), list):
                taken[:1] = cast(list[dict[str, object]], summands)  # one list, however many laws are summed
            stack.append({item.name.lower(): taken, "parameters": numbers.tolist()})
        return stack[0]
