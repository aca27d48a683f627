"""Bundles of rivers: named rivers that are summed, as a flow and as a force."""

from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from controllers.checks import check_field_types
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Law, Program
from controllers.fields.river import River
from geometry.arrays import Array


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

    @property
    def curves(self) -> tuple[Trajectory, ...]:
        """Curves of the rivers."""
        return tuple(river.curve for river in self.rivers)

    def flow(self, t: float, p: Array) -> Array:
        """V(p) [m/s], shape (3,)."""
        return np.sum([river.flow(t, p) for river in self.rivers], axis=0)

    def _compose(self) -> Program:
        return reduce(add, (river.program() for river in self.rivers))
