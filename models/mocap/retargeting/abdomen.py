"""Choice of the abdomen among the joints of a spine, by their positions between hips and shoulders."""

from itertools import pairwise

import numpy as np

from geometry.arrays import Array
from models.humanoid.skeleton import figure_model
from models.mocap.retargeting.body_lines import BodyLines
from models.mocap.retargeting.skeleton_roles import Roles, middle_of

# Distance of two joints that count as one place, as a fraction of the trunk: half or twice changes none of 17 captures.
_SAME_PLACE_RATIO = 0.02
# Least fraction of a bone that lies along the figure's abdomen: captured spines of 2 to 4 joints have 0.6 to 1.0.
_MIN_OVERLAP_RATIO = 0.25


def with_abdomen(roles: Roles, lines: BodyLines, positions: Array) -> Roles:
    """The roles with the joint whose bone lies along the figure's abdomen, for joint positions (n, joints, 3).

    It is the middle joint, where joints at one place count as the last of them. If its bone lies elsewhere, as in
    spines that are divided only below or only above, it is the joint whose bone lies most along the abdomen.
    """
    if len(roles.spine) < 2 or not lines.has_arms:
        return roles
    trunk = lines.trunk / np.sum(lines.trunk**2, axis=1, keepdims=True)
    spine = list(roles.spine)
    heights = np.median(np.sum((positions[:, spine] - lines.middle[:, None]) * trunk[:, None], axis=2), axis=0)
    ends = [*heights, 1.0]
    kept = [k for k, (low, high) in enumerate(pairwise(ends)) if high - low > _SAME_PLACE_RATIO or k == len(spine) - 1]
    if len(kept) < 2:
        return roles
    ends = [*(float(heights[k]) for k in kept), 1.0]
    low, high = _figure_abdomen()
    overlaps = {
        spine[k]: (max(0.0, min(end, high) - max(start, low)), end - start)
        for k, (start, end) in zip(kept, pairwise(ends), strict=True)
    }
    joint = middle_of([spine[k] for k in kept])
    overlap, length = overlaps[joint]
    if overlap < _MIN_OVERLAP_RATIO * length:
        joint = max((spine[k] for k in kept[:-1]), key=lambda k: overlaps[k][0])
    return roles._replace(segments=roles.segments | {"abdomen": joint})


def _figure_abdomen() -> tuple[float, float]:
    """Start and end of the figure's abdomen between hips and shoulders, as fractions."""
    model = figure_model()
    heights = np.cumsum([model.body(body).pos[2] for body in ("abdomen", "chest", "left_clavicle", "left_upper_arm")])
    return float(heights[0] / heights[-1]), float(heights[1] / heights[-1])
