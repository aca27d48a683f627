r"""Clearance of a blend's feet in swing, also between the mixtures at which footfalls were found.

Which foot steps, and when, may change from one mixture of the clips to the next. Half way between two such nodes a
table has a foot move as the one says, and lifted as the other: it would be dragged over the floor. So the
interpolated paths of the soles' points are looked at between the nodes too. Where a point p is dragged a way D about
a moment while its height h over the ground is less than h_c, its foot lacks

.. math:: N = S\Bigl(\frac{D - D_0}{D_1 - D_0}\Bigr)\, S\Bigl(\frac{|\dot p|}{v}\Bigr)\, (h_c - h)_+,

or as much as it is deeper than h_d in the ground. The nodes around lift it by the largest N, widened in time; this is
done again where that was not enough. Where a clip is alone its own slides are its.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import convolve1d, maximum_filter1d, uniform_filter1d
from scipy.spatial.transform import Rotation

from controllers.legs.footfalls import MeanEnd, mean_end, own_shares, smooth_step
from controllers.legs.limb_ends import grounds
from controllers.legs.limbs import Limb
from controllers.motion.inbetween import FOOT, ROOT
from controllers.motion.loops import turned
from controllers.state import Array

_CLEAR, _TOUCHES = 0.005, 0.004  # h_c, and how low what moves is dragged in full [m]
_LEAST, _MOST = 0.0265, 0.029  # D_0, D_1 [m]
_DEEP = 0.005  # h_d [m]
_FAST = 0.3  # v [m a lap]
_MOMENT = 0.1  # share of the lap over which D is taken
_SPREAD = 0.012  # share of the lap by which a lift begins early and ends late
_TAKES_PART = 0.02  # least share that a node around has in the place between
_ALONE = 0.1  # by which a clip's share of its own slides is less than 1 where feet are lifted in full
_ROUNDS = 4


def cleared(
    values: Array, channels: Array, drifts: Array, limbs: Sequence[Limb], nodes: Array, between: Array, shares: Array
) -> Array:
    """Corrections at nodes, with feet raised that would be dragged between them.

    Parameters
    ----------
    values : Array, shape (n, k, 2 + 4 limbs)
        Of `foot_corrections` at the nodes.
    channels, drifts, limbs
        As there.
    nodes, between : Array, shapes (k, m), (c, m)
        Weights of the clips at the nodes, and at places between them.
    shares : Array, shape (c, k)
        By which the nodes' values are interpolated at these.

    Returns
    -------
    Array, shape (n, k, 2 + 4 limbs)
    """
    n, result = len(values), values.copy()
    width = max(1, round(_SPREAD * n))
    bump = np.hanning(2 * width + 3)
    ground = between @ grounds(channels, limbs)
    mixed = smooth_step((1.0 - own_shares(channels, nodes).sum(axis=1)) / _ALONE)
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
    """From the centre of a limb's points to each of them [m], shape (n, c, points, 3)."""
    turns = Rotation.from_quat(turn.reshape(-1, 4), scalar_first=True)
    levers = [turns.apply(point) for point in limb.points - limb.points.mean(axis=0)]
    return np.stack(levers, axis=1).reshape(*turn.shape[:2], -1, 3)


def _lacking(end: MeanEnd, levers: Array, d: Array, ground: Array) -> Array:
    """N of a foot with corrections d (n, c, 4) over the ground at heights (c,), shape (n, c)."""
    n = len(d)
    height = (end.place[..., 2] + d[..., 2] - ground)[..., None] + levers[..., 2]
    low = np.maximum(_CLEAR - height, 0.0)
    place = (end.place[..., :2] + d[..., :2])[..., None, :] + turned(d[..., 3:], levers[..., :2])
    place = turned(end.angle[..., None], np.concatenate([place, place[:1]])) + end.shift[..., None, :]
    way = np.linalg.norm(np.diff(place, axis=0), axis=-1)
    touches = smooth_step(low / (_CLEAR - _TOUCHES))
    moment = max(1, round(_MOMENT * n))
    on_ground = way * np.minimum(touches, np.roll(touches, -1, axis=0))
    dragged = moment * uniform_filter1d(on_ground, moment, axis=0, mode="wrap")
    # Of the two steps beside a sample.
    speed = n * np.maximum(way, np.roll(way, 1, axis=0))
    lacks = smooth_step((dragged - _LEAST) / (_MOST - _LEAST)) * smooth_step(speed / _FAST) * low
    return np.maximum(lacks, -_DEEP - height).max(axis=2)
