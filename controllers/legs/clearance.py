r"""Swing clearance of a blend's feet between the mixtures (nodes) at which footfalls were computed.

Which foot steps, and when, may change from one mixture of the clips to the next. Half way between two such nodes the
interpolated table moves a foot as at one node and lifts it as at the other: it would be dragged over the floor. So the
interpolated paths of the sole points are also checked between the nodes. Where a point p is dragged over a distance D
around a moment while its height h over the ground is less than h_c, its foot lacks the clearance

.. math:: N = S\Bigl(\frac{D - D_0}{D_1 - D_0}\Bigr)\, S\Bigl(\frac{|\dot p|}{v}\Bigr)\, (h_c - h)_+,

or, if larger, its penetration into the ground beyond h_d. The surrounding nodes are raised by the largest N, widened in
time; this is repeated where it was not enough. A clip alone keeps its own foot skate.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import convolve1d, maximum_filter1d, uniform_filter1d
from scipy.spatial.transform import Rotation

from controllers.easing import smooth_steps
from controllers.legs.footfalls import MeanEnd, mean_end, own_shares
from controllers.legs.limb_ends import grounds
from controllers.legs.limbs import Limb
from controllers.motion.inbetween import FOOT, ROOT
from controllers.motion.loops import turned
from controllers.state import Array

_CLEAR, _DRAGGED_FULLY = 0.005, 0.004  # [m] h_c, and the height below which a moving point counts fully as dragged
_LEAST, _MOST = 0.0265, 0.029  # D_0, D_1 [m]
_DEEP = 0.005  # h_d [m]
_FAST = 0.3  # v [m per lap]
_MOMENT = 0.1  # share of the lap over which D is accumulated
_SPREAD = 0.012  # share of the lap by which a lift begins early and ends late
_TAKES_PART = 0.02  # least interpolation weight of a node that is raised for a point between nodes
_ALONE = 0.1  # how far below 1 the kept share of the clips' own skate must be for feet to be raised in full
_ROUNDS = 4  # iterations


def cleared(
    values: Array, channels: Array, drifts: Array, limbs: Sequence[Limb], nodes: Array, between: Array, shares: Array
) -> Array:
    """Corrections at nodes, raised where feet would be dragged between the nodes.

    Parameters
    ----------
    values : Array, shape (n, k, 2 + 4 limbs)
        `foot_corrections` at the nodes.
    channels, drifts, limbs
        As in `foot_corrections`.
    nodes, between : Array, shapes (k, m), (c, m)
        Weights of the clips at the nodes, and at points between them.
    shares : Array, shape (c, k)
        Interpolation weights of the nodes at those points.

    Returns
    -------
    Array, shape (n, k, 2 + 4 limbs)
    """
    n, result = len(values), values.copy()
    width = max(1, round(_SPREAD * n))
    bump = np.hanning(2 * width + 3)
    ground = between @ grounds(channels, limbs)
    mixed = smooth_steps((1.0 - own_shares(channels, nodes).sum(axis=1)) / _ALONE)
    for j, limb in enumerate(limbs):
        foot = slice(ROOT + FOOT * j, ROOT + FOOT * (j + 1))
        end = mean_end(channels, drifts, limbs, j, between)
        levers = _levers(end.turn, limb)
        looked_at = np.arange(len(between))
        for _ in range(_ROUNDS):
            there = MeanEnd(*(part[:, looked_at] for part in end))
            lacking = _lacking(there, levers[:, looked_at], shares[looked_at] @ result[..., foot], ground[looked_at])
            dragged = lacking.any(axis=0)
            if not dragged.any():
                break
            looked_at, lacking = looked_at[dragged], lacking[:, dragged]
            wide = maximum_filter1d(lacking, 2 * width + 1, axis=0, mode="wrap")
            wide = convolve1d(wide, bump / bump.sum(), axis=0, mode="wrap")
            for k, around in enumerate(np.abs(shares[looked_at].T) > _TAKES_PART):
                result[:, k, foot.start + 2] += mixed[k] * wide[:, around].max(axis=1, initial=0.0)
    return result


def _levers(turn: Array, limb: Limb) -> Array:
    """Vectors from the centre of a limb's points to each point [m], shape (n, c, points, 3)."""
    turns = Rotation.from_quat(turn.reshape(-1, 4), scalar_first=True)
    levers = [turns.apply(point) for point in limb.points - limb.points.mean(axis=0)]
    return np.stack(levers, axis=1).reshape(*turn.shape[:2], -1, 3)


def _lacking(end: MeanEnd, levers: Array, d: Array, ground: Array) -> Array:
    """Lacking clearance N [m] of a foot with corrections d (n, c, 4), over ground at heights (c,); shape (n, c)."""
    n = len(d)
    height = (end.place[..., 2] + d[..., 2] - ground)[..., None] + levers[..., 2]
    low = np.maximum(_CLEAR - height, 0.0)
    place = (end.place[..., :2] + d[..., :2])[..., None, :] + turned(d[..., 3:], levers[..., :2])
    place = turned(end.angle[..., None], np.concatenate([place, place[:1]])) + end.shift[..., None, :]
    way = np.linalg.norm(np.diff(place, axis=0), axis=-1)
    touches = smooth_steps(low / (_CLEAR - _DRAGGED_FULLY))
    moment = max(1, round(_MOMENT * n))
    on_ground = way * np.minimum(touches, np.roll(touches, -1, axis=0))
    dragged = moment * uniform_filter1d(on_ground, moment, axis=0, mode="wrap")
    # The larger of the two steps beside a sample.
    speed = n * np.maximum(way, np.roll(way, 1, axis=0))
    lacks = smooth_steps((dragged - _LEAST) / (_MOST - _LEAST)) * smooth_steps(speed / _FAST) * low
    return np.maximum(lacks, -_DEEP - height).max(axis=2)
