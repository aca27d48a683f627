"""The abdomen among the joints of a spine, by where they lie between hips and shoulders."""

from itertools import pairwise

import numpy as np

from models.arrays import Array
from models.humanoid.skeleton import figure_model
from models.mocap.retargeting.body_lines import BodyLines
from models.mocap.retargeting.skeleton_roles import Roles, middle_of

# Distance of two joints that are at one place, as a share of the trunk: half or twice changes none of 17 captures.
_PLACE = 0.02
_ALONG = 0.25  # least share of a bone along the figure's abdomen: captured spines of 2 to 4 joints have 0.6 to 1.0


def with_abdomen(roles: Roles, lines: BodyLines, positions: Array) -> Roles:
    """The roles with the joint whose bone lies along the figure's abdomen, for joint positions (n, joints, 3).

    It is the middle joint, where those at one place count as the last of them; or, where its bone lies elsewhere, as in
    spines that are divided below or above only, the one that lies most along the abdomen.
    """
    if len(roles.spine) < 2 or not lines.has_arms:
        return roles
    trunk = lines.trunk / np.sum(lines.trunk**2, axis=1, keepdims=True)
    spine = list(roles.spine)
    heights = np.median(np.sum((positions[:, spine] - lines.middle[:, None]) * trunk[:, None], axis=2), axis=0)
    ends = [*heights, 1.0]
    apart = [k for k, (low, high) in enumerate(pairwise(ends)) if high - low > _PLACE or k == len(spine) - 1]
    if len(apart) < 2:
        return roles
    ends = [*(float(heights[k]) for k in apart), 1.0]
    low, high = _own_abdomen()
    along = {
        spine[k]: (max(0.0, min(end, high) - max(start, low)), end - start)
        for k, (start, end) in zip(apart, pairwise(ends), strict=True)
    }
    joint = middle_of([spine[k] for k in apart])
    overlap, length = along[joint]
    if overlap < _ALONG * length:
        joint = max((spine[k] for k in apart[:-1]), key=lambda k: along[k][0])
    return roles._replace(segments=roles.segments | {"abdomen": joint})


def _own_abdomen() -> tuple[float, float]:
    """Where the figure's abdomen begins and ends between hips and shoulders, as shares."""
    model = figure_model()
    heights = np.cumsum([model.body(body).pos[2] for body in ("abdomen", "chest", "left_clavicle", "left_upper_arm")])
    return float(heights[0] / heights[-1]), float(heights[1] / heights[-1])
