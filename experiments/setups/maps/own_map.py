"""Set-up of a user-defined map, about a curve and without clips."""

from typing import Any, cast

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import HapticMap
from experiments.config.maps import Circle
from experiments.setups.parts.pace import check_reach
from experiments.setups.parts.part_types import ClipMapParts
from models.humanoid.skeleton import N_POSE

_N_COMPARED = 5  # phases of a lap at which a user-defined derivative is checked: few symmetries of a map share all five


def own_parts(haptic_map: HapticMap, curve: Trajectory) -> ClipMapParts:
    """Map parts of a user-defined map about a curve, without clips.

    Raises
    ------
    ParameterError
        If its poses are not poses of the figure, or its derivative is not that of its poses.
    """
    if haptic_map.nq != N_POSE:
        name = type(haptic_map).__name__
        raise ParameterError(f"poses of {name} have {haptic_map.nq} numbers; the figure's have {N_POSE}")

    haptic_map.check_jacobian(curve.point(np.linspace(curve.start, curve.end, _N_COMPARED, endpoint=False)))

    def none(*_: object) -> Any:
        raise ParameterError("a user-defined map has no rivers; expected another field")

    return ClipMapParts(
        haptic_map=cast(ClipMap, haptic_map), clips=(), curve=check_reach(curve), reach=Circle().radius, rivers=none,
        river_pushes=none, course=lambda damping, stiffness: curve,
    )  # fmt: skip
