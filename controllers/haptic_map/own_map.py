"""User-defined maps in Python, called by the compiled tick through the address of a C callback.

The tick runs without the GIL; the callback holds the GIL while the map computes a pose.
"""

import ctypes
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from controllers.checks import numbers_of
from controllers.errors import ParameterError
from controllers.state import Pose
from geometry.arrays import Array
from geometry.rotations import logarithm, multiply

_DOUBLE_POINTER = ctypes.POINTER(ctypes.c_double)
_CALLBACK_TYPE = ctypes.CFUNCTYPE(
    None, _DOUBLE_POINTER, _DOUBLE_POINTER, _DOUBLE_POINTER, ctypes.c_int64, ctypes.c_int64
)
N_FIGURE_POSE = 75
"""Numbers of a pose of the figure: root position, root quaternion and 17 joint quaternions."""
_NORM_TOLERANCE = 1e-3  # largest error of a quaternion's norm: more than single precision, less than an arbitrary scale
# [m, rad] step of central differences: cube root of the rounding error, for lengths of some centimetres
_DIFFERENCE_STEP = 1e-5
# fraction of the largest entry: a wrong sign, unit, frame or column errs by more, differences by 1e-7
_DERIVATIVE_TOLERANCE = 1e-3


@intrinsic
def _call_c_function(typingctx: Any, address: Any, x: Any, pose: Any, jacobian: Any, nq: Any, rows: Any) -> Any:
    """Call ``void (double *x, double *pose, double *jacobian, int64 nq, int64 rows)``; all are given as int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer, word = ir.DoubleType().as_pointer(), ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer, pointer, word, word]).as_pointer()
        place, *arrays, nq, rows = arguments
        given = [*(builder.inttoptr(array, pointer) for array in arrays), nq, rows]
        builder.call(builder.inttoptr(place, kind), given)
        return context.get_dummy_value()

    return types.void(*[types.int64] * 6), generate


_call_callback = cast(Callable[[int, int, int, int, int, int], None], _call_c_function)


@njit
def python_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of a map in Python: the first parameter holds the address of the callback (see `PythonCallback`)."""
    place, rows = params.view(np.int64)[0], jacobian.shape[0]
    _call_callback(place, x.ctypes.data, pose.ctypes.data, jacobian.ctypes.data, pose.shape[0], rows)


class PythonCallback:
    """C callback of a map for the tick; the first error in a run is stored, and the pose then stays at its last value.

    Parameters
    ----------
    name : str
        The map, for messages.
    pose, jacobian : callable
        From a stylus pose (7,) to a configuration (nq,), and to the derivative (nv, 6).
    """

    def __init__(self, name: str, pose: Callable[[Array], Pose], jacobian: Callable[[Array], Array]):
        self.error: BaseException | None = None
        self._last = np.zeros(0)

        def evaluate(x: Any, target: Any, derivative: Any, nq: int, rows: int) -> None:
            last = self._last  # local to this call, since the runs of a sweep call in several threads
            if self.error is None:
                stylus = np.ctypeslib.as_array(x, (7,))  # copied, since a map may change its argument (x[:3] -= centre)
                self._last = last = checked_pose(pose(stylus.copy()), nq, name, stylus)
                if rows:
                    np.ctypeslib.as_array(derivative, (rows, 6))[:] = checked_jacobian(
                        jacobian(stylus.copy()), rows, name, stylus
                    )
            np.ctypeslib.as_array(target, (nq,))[:] = last

        def callback(*given: Any) -> None:
            try:
                evaluate(*given)
            except BaseException as error:  # no exception may leave a C callback, not even Ctrl-C: it would be ignored
                self.error = error
                evaluate(*given)

        self._callback = _CALLBACK_TYPE(callback)
        address = ctypes.cast(self._callback, ctypes.c_void_p).value or 0
        self.params: Array = np.array([address], dtype=np.int64).view(np.float64)

    def begin(self, start: Pose) -> None:
        """Clear the error of the previous run; the configuration is `start` before the first call."""
        self.error, self._last = None, start


def checked_pose(pose: Any, nq: int, name: str, x: Array) -> Pose:
    """Validate a configuration that a map gave at x (7,): `nq` finite numbers, with unit quaternions if the figure's.

    Raises
    ------
    ParameterError
        If the pose has another shape, a number that is not finite, or a quaternion whose norm is not 1.
    """
    numbers = numbers_of(f"the pose of map {name} at {_where(x)}", pose)
    if numbers.shape != (nq,) or not np.isfinite(numbers).all():
        which = "" if numbers.shape != (nq,) else f" with {numbers[~np.isfinite(numbers)][0]} in it"
        raise ParameterError(
            f"map {name} gave a pose of shape {numbers.shape}{which} at {_where(x)}; expected {nq} finite numbers"
        )
    if nq == N_FIGURE_POSE:
        norms = np.sqrt((numbers[3:].reshape(-1, 4) ** 2).sum(axis=1))
        worst = int(np.argmax(np.abs(norms - 1.0)))
        if abs(norms[worst] - 1.0) > _NORM_TOLERANCE:
            first, whose = 3 + 4 * worst, f"joint {worst}" if worst else "the root"
            raise ParameterError(
                f"map {name} gave a quaternion of norm {norms[worst]:.4g} for {whose}, pose[{first}:{first + 4}], at "
                f"{_where(x)}; expected 1"
            )
    return numbers


def checked_jacobian(jacobian: Any, nv: int, name: str, x: Array) -> Array:
    """Validate a derivative that a map gave at a stylus pose (7,): finite numbers of shape (nv, 6).

    Raises
    ------
    ParameterError
        If the derivative has another shape or a number that is not finite.
    """
    numbers = numbers_of(f"the jacobian of map {name} at {_where(x)}", jacobian)
    if numbers.shape != (nv, 6):
        raise ParameterError(
            f"map {name} gave a jacobian of shape {numbers.shape}; expected ({nv}, 6), or none: "
            "it is then computed by finite differences"
        )
    if not np.isfinite(numbers).all():
        raise ParameterError(
            f"map {name} gave a jacobian with a number that is not finite at {_where(x)}; expected finite ones"
        )
    return numbers


def _where(x: Array) -> str:
    return f"p = [{x[0]:.4g}, {x[1]:.4g}, {x[2]:.4g}]"


def check_derivative(jacobian: Array, pose: Callable[[Array], Pose], name: str, x: Array) -> None:
    """Compare a map's derivative (nv, 6) at a stylus pose (7,) with finite differences of the pose.

    Where the differences with two step sizes do not agree, the map is not smooth, and nothing is compared.

    Raises
    ------
    ParameterError
        If an entry differs by more than a thousandth of the largest one.
    """
    expected, coarse = finite_differences(pose, x), finite_differences(pose, x, 10.0 * _DIFFERENCE_STEP)
    allowed = _DERIVATIVE_TOLERANCE * max(float(np.abs(expected).max()), _DERIVATIVE_TOLERANCE)
    errors = np.abs(jacobian - expected)
    if errors.max() <= allowed or np.abs(coarse - expected).max() > allowed:
        return
    row, column = np.unravel_index(np.argmax(errors), errors.shape)
    raise ParameterError(
        f"the jacobian of map {name} is {jacobian[row, column]:.4g} in row {row}, column {column} at {_where(x)}, "
        f"and its pose changes by {expected[row, column]:.4g} there; expected the same, linear before angular velocity "
        "in the columns, or no jacobian: it is then computed by finite differences"
    )


def difference(before: Pose, after: Pose) -> Array:
    """Tangent that leads from one configuration to another in unit time, shape (nv,).

    Root velocity in the world; angular velocity of root and joints in their own frames, as in MuJoCo's qvel.
    """
    parts = [after[:3] - before[:3]]
    for k in range(3, len(before), 4):
        w, x, y, z = before[k : k + 4]
        parts.append(np.array(logarithm(*multiply(w, -x, -y, -z, *after[k : k + 4]))))
    return np.concatenate(parts)


def finite_differences(pose: Callable[[Array], Pose], x: Array, step: float = _DIFFERENCE_STEP) -> Array:
    """Derivative of a map at a stylus pose (7,) by central differences of a step [m, rad], shape (nv, 6)."""
    columns: list[Array] = []
    for k in range(6):
        before, after = (_displace(x, k, distance) for distance in (-step, step))
        first = np.array(pose(before))  # copied, since a map may return one array that it writes anew
        columns.append(difference(first, pose(after)) / (2.0 * step))
    return np.stack(columns, axis=1)


def _displace(x: Array, k: int, distance: float) -> Array:
    """A stylus pose moved along axis k of H, or turned about axis k − 3, by a distance [m] or an angle [rad]."""
    moved = x.copy()
    if k < 3:
        moved[k] += distance
        return moved
    turn = np.zeros(4)
    turn[0], turn[k - 2] = np.cos(0.5 * distance), np.sin(0.5 * distance)
    moved[3:] = multiply(*turn, *x[3:])
    return moved
