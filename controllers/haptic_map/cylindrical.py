"""The cylindrical map: the angle is the phase, radius and height blend four clips (Donald & Henle 2000, Fig. 3)."""

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cache

import numpy as np
from numba import njit

from controllers.blending.alignment import aligned_channels
from controllers.blending.blend import blend_corrected
from controllers.blending.clip_arrays import clip_arrays, stored_array, stored_clips, stored_limbs
from controllers.blending.combination import Mixture
from controllers.curves.cylinder import AXIS, blend_weight, checked_interval, cylinder, eased_weight
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap, arms_of_others, stored_lap
from controllers.legs.footfalls import foot_corrections
from controllers.legs.limb_ends import with_ends
from controllers.legs.limbs import Limb
from controllers.legs.stance_hold import fresh_footing
from controllers.motion.inbetween import FOOT, ROOT, correction, packed_table, table_channels
from controllers.work_array import work_array
from geometry.arrays import Array

_CLIPS = 4
_CLIP_NAMES = ("the first clip", "the second clip", "the third clip", "the fourth clip")
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


class Cylindrical(AnimationMap):
    r"""Four clips round a cylinder about the z axis of H.

    θ = atan2(y, x) is the phase: one lap of the hand is one lap of every clip. The weights w_i(r, z) blend the four
    clips bilinearly with eased edges (C²) and are constant beyond them, so no limb is ever extrapolated. `blending`
    describes how poses are blended. With limbs, in-betweens are corrected by a table (`inbetween`): feet move one at a
    time while they are lifted (`footfalls`), and the root may sway (`with_sway`). While the hand changes the mixture,
    feet in stance keep their places (`stance_hold`).

    The mean of clips with different footsteps is not a gait: while one clip plants a foot, another lifts it. With
    `upper`, only those joints are blended; root, legs and feet are those of one clip everywhere. Where that clip's legs
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
        Limbs whose ends (feet) are placed at the mean of their positions in the clips (see `limbs`).
    corrections : Array, shape (n, k, 2 + 4 limbs), optional
        `corrections` of a map of the same clips, limbs and lap, to spare computing them again.
    lap : float, optional
        Duration of the hand's lap [s], in which each clip is played as often as it fits (`strides`); by default once.
    upper : sequence of int
        The only joints that are blended, counted from 1; by default all.
    legs_of : int
        With `upper`, the clip that gives legs and root, counted from 0.

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
    called : tuple of four str
        What remarks call the clips; it may be set.

    Raises
    ------
    ParameterError
        If there are not four clips with poses of one size, an interval is empty, or the poses lack a limb's joints.
    """

    map_kernel = staticmethod(cylindrical_map)
    share_at = _SHARE
    called: tuple[str, ...] = _CLIP_NAMES

    def __init__(
        self,
        clips: Sequence[tuple[Array, float]],
        r_range: tuple[float, float],
        z_range: tuple[float, float],
        limbs: Sequence[Limb] = (),
        corrections: Array | None = None,
        lap: float | None = None,
        upper: Sequence[int] = (),
        legs_of: int = 0,
    ) -> None:
        if len(clips) != _CLIPS:
            raise ParameterError(
                f"the cylindrical map blends {_CLIPS} clips, got {len(clips)}; give one more than once"
            )
        self.r_range, self.z_range = r_range, z_range
        numbers = (*checked_interval("r_range", r_range, AXIS), *checked_interval("z_range", z_range, -np.inf))
        if not 0 <= legs_of < _CLIPS:
            raise ParameterError(f"legs are of clip 0 to {_CLIPS - 1}, got {legs_of}")
        self.upper, self.legs_of = tuple(upper), legs_of
        legs = 1.0 + legs_of if self.upper else 0.0
        super().__init__(clips, (*numbers, legs, 1.0, 0.0), upper, limbs, lap,
                         len(self.upper) > 0)  # fmt: skip
        self._intervals = numbers
        self._nodes, self.mixtures = (values.copy() for values in _mixtures())
        self.drifts: Array = np.stack([loop.drift for loop in self.loops])
        self.corrections: Array = np.empty((0, len(self.mixtures), ROOT))
        if limbs:
            self._set_corrections(self._compute_corrections(limbs) if corrections is None else corrections)

    def fresh_memory(self) -> Array:
        """As in `ClipMap`, and a footing where legs are blended."""
        if self.upper or not self.limbs:
            return super().fresh_memory()
        return np.concatenate([super().fresh_memory(), fresh_footing(len(self.limbs))])

    def _compute_corrections(self, limbs: Sequence[Limb]) -> Array:
        if self.upper:
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
    def remarks(self) -> tuple[str, ...]:
        """A remark if only some joints are blended."""
        if not self.upper:
            return ()
        remark = f"the clips are too different to average, so legs and trunk are those of {self.called[self.legs_of]}"
        if self.share < 1.0:
            remark += f", with {arms_of_others(self.share)}"
        return (remark,)

    @property
    def lap_durations(self) -> Array:
        """As in `AnimationMap`; only that of the legs' clip if no other is blended in."""
        return super().lap_durations if self.share > 0.0 else np.array([self.loops[self.legs_of].duration])

    @property
    def lap_seconds(self) -> float:
        """As in `AnimationMap`."""
        return self.loops[self.legs_of].duration if self.upper else super().lap_seconds

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

    def arrays(self) -> dict[str, Array]:
        """The map as arrays by key; `from_arrays` restores it from them bit for bit."""
        arrays = {"domain": np.array([self.r_range, self.z_range])}
        if self.upper:
            arrays["upper_joints"] = np.array(self.upper, dtype=np.float64)
            arrays["legs_of"], arrays["share"] = np.array([float(self.legs_of)]), np.array([self.share])
        if self.limbs:
            arrays["corrections"] = self.corrections
        return arrays | self.lap_array() | clip_arrays(self.clips, self.names, self.limbs)

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> "Cylindrical":
        """Map restored from the output of `arrays`.

        Raises
        ------
        ParameterError
            If an array is missing, or its values are not those of a map.
        """
        (r_low, r_high), (z_low, z_high) = stored_array(arrays, "domain", (2, 2)).tolist()
        limbs, corrections = stored_limbs(arrays), None
        if limbs:
            corrections = stored_array(arrays, "corrections", (None, *correction_shape(len(limbs))))
        upper = stored_array(arrays, "upper_joints", (None,)) if "upper_joints" in arrays else np.zeros(0)
        if not np.isfinite(upper).all():
            raise ParameterError(f"'upper_joints' of the map must be finite, got {upper}")
        clips, joints = stored_clips(arrays), [int(joint) for joint in upper]
        owner = int(stored_array(arrays, "legs_of", (1,))[0]) if "legs_of" in arrays else 0
        share = float(stored_array(arrays, "share", (1,))[0]) if "share" in arrays else 1.0
        result = Cylindrical(
            clips, (r_low, r_high), (z_low, z_high), limbs, corrections, stored_lap(arrays), joints, owner
        )  # fmt: skip
        return result.with_share(share) if joints else result
