"""The cylindrical map: the angle is the phase, radius and height blend four clips (Donald & Henle 2000, Fig. 3)."""

from collections.abc import Sequence
from copy import copy
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.blending.alignment import aligned_channels
from controllers.blending.blend import blend_corrected
from controllers.blending.combination import Mixture
from controllers.curves.cylinder import AXIS, blend_weight, checked_interval, cylinder, eased_weight
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap, arms_of_others
from controllers.legs.footfalls import foot_corrections
from controllers.legs.limb_ends import with_ends
from controllers.legs.limbs import Limb
from controllers.legs.stance_hold import fresh_footing
from controllers.motion.inbetween import FOOT, ROOT, correction, packed_table, table_channels
from controllers.work_array import work_array
from geometry.arrays import Array

_CLIPS = 4
_R_MIN, _R_MAX, _Z_MIN, _Z_MAX, _LEGS_OF, _SHARE, _TABLE_SIZE, _TABLE = range(8)
# Nodes of the table of corrections along each of r and z: a blend of cheer and ginga slides 1.0 cm, also with 9 and 17;
# one of walk, run, ginga and cheer, which no map blends as a whole, slides 7.5 cm, with 9 and 17 nodes 6.0 and 5.4 cm.
_NODES = 13
# eased fraction at each end of the table's coordinates: nodes are dense where a clip's weight is small
_TABLE_EASING = 0.05
_MAX_ROWS = 512  # largest number of rows of the table round the lap


@njit
def cylindrical_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Cylindrical`: h(x), and h_*(x) unless `jacobian` has no rows."""
    chain = work_array((3, 6))
    radius, angle = cylinder(x, chain)
    a, a_slope = blend_weight(radius, params[_R_MIN], params[_R_MAX])
    b, b_slope = blend_weight(x[2], params[_Z_MIN], params[_Z_MAX])
    owner = int(params[_LEGS_OF]) - 1
    last = 1 if owner >= 0 else 0
    weights, changes = work_array((1 + last, _CLIPS)), work_array((1 + last, 3, _CLIPS))
    weights[:], changes[:] = 0.0, 0.0
    weights[0, max(owner, 0)] = 1.0
    for i in range(_CLIPS):
        w_r, d_r = (a, a_slope) if i % 2 == 1 else (1.0 - a, -a_slope)
        w_z, d_z = (b, b_slope) if i >= 2 else (1.0 - b, -b_slope)
        weights[last, i], changes[last, 1, i], changes[last, 2, i] = w_r * w_z, d_r * w_z, w_r * d_z
    if owner >= 0:
        for i in range(_CLIPS):
            weights[1, i] *= params[_SHARE]
            changes[1, 1, i] *= params[_SHARE]
            changes[1, 2, i] *= params[_SHARE]
        weights[1, owner] += 1.0 - params[_SHARE]
    size = int(params[_TABLE_SIZE])
    table = params[_TABLE : _TABLE + size]
    d = work_array((4, table_channels(table) if size > 0 else 0))
    if size > 0:
        i, i_slope = blend_weight(radius, params[_R_MIN], params[_R_MAX], _TABLE_EASING)
        j, j_slope = blend_weight(x[2], params[_Z_MIN], params[_Z_MAX], _TABLE_EASING)
        correction(table, angle, i, j, d, jacobian.shape[0] > 0)
        for k in range(d.shape[1]):
            d[2, k] *= i_slope
            d[3, k] *= j_slope
    blend_corrected(params[_TABLE + size :], angle, Mixture(weights, changes, chain, d), memory, pose, jacobian)


@cache
def _mixtures() -> tuple[Array, Array]:
    """The table's nodes (k, 2), as shares of r and z, and the weights of the clips there (k, 4)."""
    ease, share = eased_weight.py_func, np.linspace(0.0, 1.0, 4001)  # in Python, since compiling would take longer
    nodes = np.interp(np.linspace(0.0, 1.0, _NODES), [ease(at, _TABLE_EASING)[0] for at in share], share)
    z, r = np.meshgrid(nodes, nodes)
    places = np.stack([r.ravel(), z.ravel()], axis=-1)
    a, b = (np.array([ease(at)[0] for at in way]) for way in places.T)
    return places, np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=-1)


def correction_shape(limbs: int) -> tuple[int, int]:
    """Shape of a map's corrections at one phase: number of mixtures, and of channels for this number of limbs."""
    return _NODES**2, ROOT + FOOT * limbs


@cache
def _table_of_zeros(shape: tuple[int, ...]) -> Array:
    """Table of maps with legs of one clip, which need no corrections."""
    return packed_table(np.zeros(shape))


class LegsOfOneClip(NamedTuple):
    """Root, trunk and legs of one clip, with the other clips blended into arms and head only.

    Attributes
    ----------
    clip : int
        Number of the clip, counted from 0.
    upper : sequence of int
        The joints that are blended, counted from 1.
    name : str
        What remarks call the clip.
    """

    clip: int
    upper: Sequence[int]
    name: str = "one clip"


class Cylindrical(AnimationMap):
    r"""Four clips round a cylinder about the z axis of H.

    θ = atan2(y, x) is the phase: one lap of the hand is one lap of every clip. The weights w_i(r, z) blend the four
    clips bilinearly with eased edges (C²) and are constant beyond them, so no limb is ever extrapolated. `blending`
    describes how poses are blended. With limbs, in-betweens are corrected by a table (`inbetween`): feet move one at a
    time while they are lifted (`footfalls`), and the root may sway (`with_sway`). While the hand changes the mixture,
    feet in stance keep their places (`stance_hold`).

    The mean of clips with different footsteps is not a gait: while one clip plants a foot, another lifts it. With
    `LegsOfOneClip`, root, legs and feet are those of one clip everywhere. Where that clip's legs
    cannot support more, only a share λ of the others' joints is blended in: the weights are λ w_i, plus 1 − λ for
    that clip.

    A ∈ SE(2) is the frame of the lap, stored in the memory: it moves by exp(Σ w_i ξ_i) each time the hand passes the
    seam θ = 0 forwards, and by the inverse backwards, so the figure walks on. Pose, velocity and acceleration are
    continuous over the seam. If no clip travels or turns, A stays the identity, and h is a function of the stylus
    position alone if no foot is held. h does not depend on the stylus orientation. On the axis r = 0 the phase, hence
    h, is not defined.

    Parameters
    ----------
    clips : sequence of four (Array, float)
        Poses (n, nq) and frames per second: at (r_min, z_min), (r_max, z_min), (r_min, z_max), (r_max, z_max). A
        pose is root position, root quaternion, then joint quaternions (wxyz). Clips that do not close are closed
        (`closed_loop`), and all are aligned to the first in time (`alignment`).
    r_range, z_range : tuple of two floats
        Intervals [m] over which the clips blend; r_min > 0.
    limbs : sequence of Limb
        Limbs whose ends (feet) are placed at the mean of their positions in the clips (see `limb_kinematics`).
    corrections : Array, shape (n, k, 2 + 4 limbs), optional
        `corrections` of a map of the same clips, limbs and lap, to spare computing them again.
    lap : float, optional
        Duration of the hand's lap [s], in which each clip is played as often as it fits (`strides`); by default once.
    legs : LegsOfOneClip, optional
        The clip that gives root and legs everywhere, and the joints that are still blended; by default all are.

    Attributes
    ----------
    mixtures : Array, shape (k, 4)
        Weights of the clips at the nodes of the table.
    corrections : Array, shape (n, k, 2 + 4 limbs)
        Corrections of root and ends at the mixtures, at equal steps of the lap; empty without limbs.
    drifts : Array, shape (4, 3)
        ξ of each clip.
    share : float
        λ (see `with_share`).

    Raises
    ------
    ParameterError
        If there are not four clips with poses of one size, an interval is empty, or the poses lack a limb's joints.
    """

    map_kernel = staticmethod(cylindrical_map)
    share_at = _SHARE

    def __init__(
        self,
        clips: Sequence[tuple[Array, float]],
        r_range: tuple[float, float],
        z_range: tuple[float, float],
        limbs: Sequence[Limb] = (),
        corrections: Array | None = None,
        lap: float | None = None,
        legs: LegsOfOneClip | None = None,
    ) -> None:
        if len(clips) != _CLIPS:
            raise ParameterError(
                f"the cylindrical map blends {_CLIPS} clips, got {len(clips)}; give one more than once"
            )
        self.r_range, self.z_range = r_range, z_range
        numbers = (*checked_interval("r_range", r_range, AXIS), *checked_interval("z_range", z_range, -np.inf))
        if legs is not None and not 0 <= legs.clip < _CLIPS:
            raise ParameterError(f"legs are of clip 0 to {_CLIPS - 1}, got {legs.clip}")
        self.legs = legs
        owner, upper = (0.0, ()) if legs is None else (1.0 + legs.clip, legs.upper)
        super().__init__(clips, (*numbers, owner, 1.0, 0.0), upper, limbs, lap, legs is not None)
        self._intervals = numbers
        self._nodes, self.mixtures = (values.copy() for values in _mixtures())
        self.drifts: Array = np.stack([loop.drift for loop in self.loops])
        self.corrections: Array = np.empty((0, len(self.mixtures), ROOT))
        if limbs:
            self._set_corrections(self._compute_corrections(limbs) if corrections is None else corrections)

    def fresh_memory(self) -> Array:
        """As in `ClipMap`, and a footing where legs are blended."""
        if self.legs or not self.limbs:
            return super().fresh_memory()
        return np.concatenate([super().fresh_memory(), fresh_footing(len(self.limbs))])

    def _compute_corrections(self, limbs: Sequence[Limb]) -> Array:
        if self.legs:
            return np.zeros((_MAX_ROWS, *correction_shape(len(limbs))))
        rows = int(np.clip(max(loop.share * len(loop.splines[0].x) for loop in self.loops), 64, _MAX_ROWS))
        channels = with_ends(aligned_channels(self.loops, rows, limbs), self.drifts, limbs)
        return foot_corrections(channels, self.drifts, limbs, self.mixtures)

    def _set_corrections(self, values: Array) -> None:
        values_at = values.reshape(len(values), _NODES, _NODES, -1)
        table = packed_table(values_at) if values.any() else _table_of_zeros(values_at.shape)
        blend = self._params[_TABLE + int(self._params[_TABLE_SIZE]) :]
        self._params = np.concatenate([self._params[:_TABLE_SIZE], [len(table)], table, blend])
        self.corrections = values

    @property
    def legs_of(self) -> int | None:
        """Clip that gives root and legs, counted from 0; None if all joints are blended."""
        return None if self.legs is None else self.legs.clip

    @property
    def remarks(self) -> tuple[str, ...]:
        """A remark if only some joints are blended."""
        if self.legs is None:
            return ()
        remark = f"the clips are too different to average, so legs and trunk are those of {self.legs.name}"
        if self.share < 1.0:
            remark += f", with {arms_of_others(self.share)}"
        return (remark,)

    @property
    def lap_durations(self) -> Array:
        """As in `AnimationMap`; only that of the legs' clip if no other is blended in."""
        if self.legs is None or self.share > 0.0:
            return super().lap_durations
        return np.array([self.loops[self.legs.clip].duration])

    @property
    def lap_seconds(self) -> float:
        """As in `AnimationMap`."""
        return self.loops[self.legs.clip].duration if self.legs else super().lap_seconds

    def places(self, angles: Array) -> Array:
        """Upright stylus poses (k, n, 7) at which the weights are those of the mixtures, at angles θ (n,)."""
        r_min, r_max, z_min, z_max = self._intervals
        r, z = r_min + self._nodes[:, 0] * (r_max - r_min), z_min + self._nodes[:, 1] * (z_max - z_min)
        x = np.zeros((len(r), len(angles), 7))
        x[..., 0], x[..., 1] = r[:, None] * np.cos(angles), r[:, None] * np.sin(angles)
        x[..., 2], x[..., 3] = z[:, None], 1.0
        return x

    def with_sway(self, sway: Array) -> "Cylindrical":
        """The same map with the root displaced over the floor at the mixtures.

        Parameters
        ----------
        sway : Array, shape (n, k, 2)
            Displacement at equal steps of the lap [m], in the frame of the drift.
        """
        other = copy(self)
        values = self.corrections.copy()
        rows = len(values)
        values[..., :ROOT] = np.fft.irfft(np.fft.rfft(sway, axis=0) * (rows / len(sway)), rows, axis=0)
        other._set_corrections(values)
        return other
