r"""Feet that are clear of the ground where they move, also between the mixtures at which footfalls were found.

Which foot steps, and when, may change from one mixture of the clips to the next. Half way between two such nodes a
table has a foot move as the one says, and lifted as the other: it would be dragged over the floor. So the
interpolated paths are looked at between the nodes too. Where a foot at p is dragged a way D about a moment while its
height h is less than h_c, it lacks

.. math:: N = S\Bigl(\frac{D - D_0}{D_1 - D_0}\Bigr)\, S\Bigl(\frac{|\dot p|}{v}\Bigr)\, (h_c - h)_+,

and the nodes around lift it by the largest N, widened in time. Where a clip is nearly alone its own slides are its.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import convolve1d, maximum_filter1d, uniform_filter1d

from controllers.haptic_map.footfalls import STANDS, BlendedFeet, blended_feet, own_shares, smooth_step
from controllers.haptic_map.inbetween import FOOT, ROOT
from controllers.haptic_map.limbs import Limb
from controllers.haptic_map.loops import turned
from controllers.state import Array

_CLEAR = 0.0065  # h_c [m]
_LEAST, _MOST = 0.027, 0.04  # D_0, D_1 [m]
_FAST = 0.5  # v [m a lap]
_MOMENT = 0.1  # share of the lap over which D is taken
_LEVER = 0.1  # [m] by which a foot that turns sweeps over the ground
_SPREAD = 0.012  # share of the lap by which a lift begins early and ends late
_TAKES_PART = 0.02  # least share that a node around has in the place between


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
    n = len(values)
    feet = blended_feet(channels, drifts, limbs, between)
    lacking = _lacking(feet, shares @ values)
    width = max(1, round(_SPREAD * n))
    bump = np.hanning(2 * width + 3)
    wide = maximum_filter1d(lacking, 2 * width + 1, axis=0, mode="wrap")
    wide = convolve1d(wide, bump / bump.sum(), axis=0, mode="wrap")
    result, mixed = values.copy(), 1.0 - own_shares(channels, nodes).sum(axis=1)
    for k, around in enumerate(np.abs(shares.T) > _TAKES_PART):
        result[:, k, ROOT + 2 :: FOOT] += mixed[k] * wide[:, around].max(axis=1)
    return result


def _lacking(feet: BlendedFeet, d: Array) -> Array:
    """N of feet with corrections d, shape (n, c, limbs)."""
    n, lacking = len(d), np.empty_like(feet.height)
    for j in range(feet.height.shape[2]):
        at = ROOT + FOOT * j
        offset = np.concatenate([d, d[:1]])[..., [at, at + 1, at + 3]]
        offset[..., :2] = turned(feet.angles[:, :, j], offset[..., :2])
        way = np.linalg.norm((feet.moves[:, :, j] + np.diff(offset, axis=0)) * [1.0, 1.0, _LEVER], axis=-1)
        # Of the two steps beside a sample.
        way = np.maximum(way, np.roll(way, 1, axis=0))
        low = np.maximum(_CLEAR - feet.height[..., j] - d[..., at + 2], 0.0)
        moment = max(1, round(_MOMENT * n))
        on_ground = way * smooth_step(low / (_CLEAR - STANDS))
        dragged = moment * uniform_filter1d(on_ground, moment, axis=0, mode="wrap")
        lacking[..., j] = smooth_step((dragged - _LEAST) / (_MOST - _LEAST)) * smooth_step(n * way / _FAST) * low
    return lacking
