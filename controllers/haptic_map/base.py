"""Interface of haptic maps, from stylus poses to configurations of a target (Donald & Henle 2000, section 2.2)."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from controllers.checks import numbers_of
from controllers.errors import ParameterError
from controllers.haptic_map import own_map
from controllers.haptic_map.map_stages import CompiledMap, register
from controllers.state import Pose, stylus_path
from geometry.arrays import Array

STYLUS = 7  # numbers of a stylus pose: p_H (3), R_H (quaternion wxyz)
STYLUS_TANGENT = 6  # linear velocity (3) and angular velocity (3), both in H
_ORIGIN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class HapticMap(ABC):
    r"""Smooth map from stylus poses to configurations of a target, and its derivative.

    .. math:: h: SE(3) \to D, \qquad h_*: \mathbb{R}^6 \to T_{h(X)}D

    A configuration has `nq` numbers and a tangent `nv`; their meaning depends on the map. A map with memory (the lap
    of a travelling animation) is a function of the stylus pose and of that memory.

    A user-defined map needs only `pose`::

        class Bow(HapticMap):
            def pose(self, x):  # p_H [m] and R_H (wxyz) -> 75 numbers
                pose = rest_pose()
                pose[7:11] = np.cos(5 * x[0]), 0, np.sin(5 * x[0]), 0
                return pose

    Its configurations are then root position, root quaternion and joint quaternions; the tick calls it in Python. Its
    derivative is computed by finite differences; a `jacobian` of its own is compared with them before a run.
    """

    map_kernel: ClassVar["staticmethod[[Array, Array, Array, Array, Array], None]"] = staticmethod(own_map.python_map)
    """The kernel of the class (see `controllers.haptic_map.map_stages`); by default one that calls Python."""
    _callback: ClassVar[own_map.PythonCallback | None] = None

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        register(cls.map_kernel)

    def __getstate__(self) -> object:
        """State to copy or pickle: all attributes but the callback, which calls this very object."""
        state = super().__getstate__()
        plain, *slots = state if isinstance(state, tuple) else (state,)
        if isinstance(plain, dict):
            plain = {name: value for name, value in plain.items() if name != "_callback"}
        return (plain, *slots) if slots else plain

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the map that are printed before a run."""
        return ()

    @abstractmethod
    def pose(self, x: Array, memory: Array | None = None) -> Pose:
        """Configuration h(x), shape (nq,), of a stylus pose (7,), in the first lap or that of the memory (updated)."""

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return numbers_of(f"the pose of map {type(self).__name__}", self.pose(np.array(_ORIGIN))).size

    @property
    def nv(self) -> int:
        """Numbers of a tangent: root velocity in the world; angular velocity of root and joints in their own frames."""
        return 6 + 3 * ((self.nq - 7) // 4)

    def compiled(self) -> CompiledMap:
        """The map in the form of its kernel, with the memory of a new run; by default a kernel that calls Python.

        Raises
        ------
        ParameterError
            If `pose` gives no valid configuration for the stylus at the origin of H.
        """
        callback = self._callback
        if callback is None:
            # Looked up by name, so that a method replaced in its class is called.
            callback = own_map.PythonCallback(type(self).__name__, lambda x: self.pose(x), lambda x: self.jacobian(x))
            object.__setattr__(self, "_callback", callback)  # kept alive here, since the tick has only its address
        origin = np.array(_ORIGIN)
        start = self.pose(origin)
        callback.begin(own_map.checked_pose(start, np.size(start), type(self).__name__, origin))
        return CompiledMap.of(self.map_kernel, callback.params, np.zeros(1))

    def check(self) -> None:
        """Raise the first error of a user-defined map that occurred when the tick called it, if there was one."""
        if self._callback is not None and self._callback.error is not None:
            raise self._callback.error

    def jacobian(self, x: Array, memory: Array | None = None) -> Array:
        """Derivative h_*(x), shape (nv, 6): columns linear, then angular velocity in H; memory as in `pose`."""
        return own_map.finite_differences(self.pose, np.asarray(x, dtype=np.float64))

    def check_jacobian(self, points: Array) -> None:
        """Compare a user-defined `jacobian` with finite differences of the pose at points (n, 3) of the upright stylus.

        Raises
        ------
        ParameterError
            If its shape is not (nv, 6), a number is not finite, or it is not the derivative where the map is smooth.
        """
        if type(self).jacobian is HapticMap.jacobian:
            return
        nq, nv, name = self.nq, self.nv, type(self).__name__
        for x in stylus_path(np.asarray(points, dtype=np.float64)):
            given = own_map.checked_jacobian(self.jacobian(x), nv, name, x)
            own_map.check_derivative(
                given, lambda moved: own_map.checked_pose(self.pose(moved), nq, name, moved), name, x
            )

    def push_forward(self, x: Array, twist: Array, memory: Array | None = None) -> Array:
        """Push-forward h_* ẋ, shape (nv,), of a stylus velocity at x to rates of the target.

        `twist`, shape (6,): linear [m/s], then angular velocity [rad/s], both in H.
        """
        return self.jacobian(x, memory) @ np.asarray(twist, dtype=np.float64)

    def pull_back(self, x: Array, torque: Array, memory: Array | None = None) -> Array:
        """Pull-back h_*ᵀ f, shape (6,), of a generalised force on the target to force [N] and moment [N m] in H.

        The power is the same: (h_*ᵀ f)·ẋ = f·(h_* ẋ). `torque`, shape (nv,): f, the force or torque on each rate.
        """
        return self.jacobian(x, memory).T @ np.asarray(torque, dtype=np.float64)


class KernelMap(HapticMap):
    """A map whose pose and derivative are computed by one compiled kernel, the `map_kernel` of its class.

    Its configurations are those of the figure, unless the class overrides `nq`.

    Parameters
    ----------
    params : Array-like, shape (n,)
        Parameters of the kernel.

    Raises
    ------
    ParameterError
        If the class has no kernel, or the parameters are not a row of numbers.
    """

    def __init__(self, params: npt.ArrayLike) -> None:
        name = type(self).__name__
        if self.map_kernel is own_map.python_map:  # which would take the first parameter for an address
            raise ParameterError(f"{name} has no kernel; expected map_kernel = staticmethod(...) of an njit function")
        self._params = numbers_of(f"params of {name}", params)
        if self._params.ndim != 1:
            raise ParameterError(f"params of {name} have the shape {self._params.shape}; expected one row of numbers")

    @property
    def nq(self) -> int:
        """Numbers of a configuration: 75, those of the figure."""
        return own_map.N_FIGURE_POSE

    def compiled(self) -> CompiledMap:
        """The map in the form of its kernel, with the memory of a new run."""
        return CompiledMap.of(self.map_kernel, self._params, self.fresh_memory())

    def fresh_memory(self) -> Array:
        """The memory of a new run; by default there is none."""
        return np.zeros(0)

    def pose(self, x: Array, memory: Array | None = None) -> Pose:
        """Configuration h(x), shape (nq,), of a stylus pose (7,), in the first lap or that of the memory (updated)."""
        return self._evaluate(x, memory, 0)[0]

    def jacobian(self, x: Array, memory: Array | None = None) -> Array:
        """Derivative h_*(x), shape (nv, 6): columns linear, then angular velocity in H; memory as in `pose`."""
        return self._evaluate(x, memory, self.nv)[1]

    def _evaluate(self, x: Array, memory: Array | None, rows: int) -> tuple[Pose, Array]:
        stylus = np.asarray(x, dtype=np.float64)
        if stylus.shape != (STYLUS,):
            raise ParameterError(f"a stylus pose has shape ({STYLUS},), got {stylus.shape}")
        pose, jacobian = np.empty(self.nq), np.empty((rows, STYLUS_TANGENT))
        self.map_kernel(self._params, stylus, self.fresh_memory() if memory is None else memory, pose, jacobian)
        return pose, jacobian


class Wrapped(HapticMap):
    """A map whose kernel, called after those of another map, changes its pose, with the same numbers and memory.

    Parameters
    ----------
    base : HapticMap
        The other map.
    params : Array
        Parameters of the kernel.
    """

    def __init__(self, base: HapticMap, params: Array) -> None:
        self.base, self._params = base, params

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return self.base.nq

    @property
    def nv(self) -> int:
        """Numbers of a tangent."""
        return self.base.nv

    def compiled(self) -> CompiledMap:
        """The other map with one more stage, and the memory of a new run."""
        return self.base.compiled().followed_by(self.map_kernel, self._params)

    def pose(self, x: Array, memory: Array | None = None) -> Pose:
        """Configuration h(x), shape (nq,), of a stylus pose (7,); memory as in the other map."""
        return self._changed(x, self.base.pose(x, memory), np.empty((0, STYLUS_TANGENT)))[0]

    def jacobian(self, x: Array, memory: Array | None = None) -> Array:
        """Derivative h_*(x), shape (nv, 6): columns linear, then angular velocity in H; memory as in the other map."""
        pose = self.base.pose(x, None if memory is None else memory.copy())
        return self._changed(x, pose, self.base.jacobian(x, memory))[1]

    def _changed(self, x: Array, pose: Pose, jacobian: Array) -> tuple[Pose, Array]:
        """Pose and derivative of the other map after the kernel, which takes no memory of its own."""
        self.map_kernel(self._params, np.asarray(x, dtype=np.float64), np.zeros(0), pose, jacobian)
        return pose, jacobian
