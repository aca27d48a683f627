"""Bundles of rivers: named rivers that are summed, as a flow and as a force, and saved as plain arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import cast

import numpy as np

from controllers.checks import check_field_types
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Law, Program
from controllers.fields.river import River
from geometry.arrays import Array

_KEYS = ("times", "positions", "quaternions", "numbers", "speeds")


@dataclass(frozen=True, eq=False)
class RiverBundle(Law):
    r"""Rivers that share a space.

    .. math:: V = \sum_i V_i, \qquad F = \sum_i F_i

    This is the static sum of section 2.3: where tubes cross, the hand feels both rivers. In a `HigherOrder` field of
    the same bundle the hand feels only the river that matches its direction and speed.

    Parameters
    ----------
    rivers : tuple of River
        At least one.
    names : tuple of str
        One name for each river, all different.

    Raises
    ------
    ParameterError
        If there is no river, or names are missing or repeated.
    """

    rivers: tuple[River, ...]
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        check_field_types(self)
        if not self.rivers or len(set(self.names)) != len(self.rivers) or len(self.names) != len(self.rivers):
            raise ParameterError(
                f"a bundle needs rivers, each with a name of its own; got {len(self.rivers)} and the names {self.names}"
            )

    def __getitem__(self, name: str) -> River:
        if name not in self.names:
            raise ParameterError(f"no river {name!r} in the bundle; there are {', '.join(self.names)}")
        return self.rivers[self.names.index(name)]

    def flow(self, t: float, p: Array) -> Array:
        """V(p) [m/s], shape (3,)."""
        return np.sum([river.flow(t, p) for river in self.rivers], axis=0)

    def _compose(self) -> Program:
        return reduce(add, (river.program() for river in self.rivers))

    def arrays(self) -> dict[str, Array]:
        """The bundle as arrays with keys ``name/what``; `from_arrays` restores it from them bit for bit."""
        arrays: dict[str, Array] = {}
        for name, river in zip(self.names, self.rivers, strict=True):
            curve = river.curve
            clamped = float(curve.ends == "clamped")
            numbers = [river.epsilon, river.tau, river.drag, float(curve.periodic), clamped]
            speeds = np.zeros((0, 2)) if river.speeds is None else river.speeds
            values = (curve.times, curve.positions, curve.quaternions, numbers, speeds)
            arrays |= {f"{name}/{key}": np.array(v, float) for key, v in zip(_KEYS, values, strict=True)}
        return arrays

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> "RiverBundle":
        """Bundle restored from the output of `arrays`.

        Raises
        ------
        ControllerError
            If an array is missing, or its values are not those of a river.
        """
        names = tuple(dict.fromkeys(key.rpartition("/")[0] for key in arrays))
        rivers: list[River] = []
        for name in names:
            missing = [key for key in _KEYS if f"{name}/{key}" not in arrays]
            if missing:
                raise ParameterError(f"river {name!r} of the bundle lacks {', '.join(missing)}")
            times, positions, quaternions, numbers, speeds = (arrays[f"{name}/{key}"] for key in _KEYS)
            if numbers.shape != (5,):
                raise ParameterError(f"river {name!r} of the bundle has {numbers.size} numbers, expected 5")
            epsilon, tau, drag, periodic, clamped = cast("list[float]", numbers.tolist())
            curve = Trajectory(times, positions, quaternions, periodic != 0.0, "clamped" if clamped else "natural")
            rivers.append(River(curve, epsilon, tau, drag, speeds if len(speeds) else None))
        return RiverBundle(tuple(rivers), names)
