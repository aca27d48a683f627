"""The cylindrical map: an angle is the frame, radius and height blend four clips (Donald & Henle 2000, Fig. 3)."""

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np
from numba import njit

from controllers.blending.alignment import aligned_channels
from controllers.blending.blend import blend_corrected
from controllers.blending.clip_arrays import clip_arrays, kept, kept_clips, kept_limbs
from controllers.curves.cylinder import blend_weight, checked_interval, cylinder, eased
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap, kept_lap
from controllers.legs.clearance import cleared
from controllers.legs.footfalls import foot_corrections
from controllers.legs.limb_ends import with_ends
from controllers.legs.limbs import Limb
from controllers.motion.inbetween import FOOT, ROOT, correction, interpolation, packed_table, table_channels
from controllers.state import Array
from controllers.work_array import work_array

CYLINDRICAL = 1
_CLIPS = 4
_ORDINALS = ("first", "second", "third", "fourth")
_R_MIN, _R_MAX, _Z_MIN, _Z_MAX, _OWN_LEGS, _SHARE, _TABLE_SIZE, _TABLE = range(8)
_NODES = 13  # of the corrections' table, across the blend each way
_BETWEEN = 2 * _NODES - 1  # places each way at which it is looked at
_EDGE = 0.05  # where it eases in: its nodes lie close where weights are small, since a small step is a step too
_ROWS = 512  # of it round the lap, at most


@njit
def cylindrical_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Cylindrical`: h(x), and h_*(x) unless `jacobian` has no rows."""
    chain = work_array((3, 6))
    radius, angle = cylinder(x, chain)
    a, a_slope = blend_weight(radius, params[_R_MIN], params[_R_MAX])
    b, b_slope = blend_weight(x[2], params[_Z_MIN], params[_Z_MAX])
    owner = int(params[_OWN_LEGS]) - 1
    last = 1 if owner >= 0 else 0
    weights, changes = work_array((1 + last, _CLIPS)), work_array((1 + last, 3, _CLIPS))
    weights[:], changes[:] = 0.0, 0.0
    weights[0, max(owner, 0)] = 1.0
    for i in range(_CLIPS):
        w_r, d_r = (a, a_slope) if i % 2 == 1 else (1.0 - a, -a_slope)
        w_z, d_z = (b, b_slope) if i >= 2 else (1.0 - b, -b_slope)
        weights[last, i], changes[last, 1, i], changes[last, 2, i] = w_r * w_z, d_r * w_z, w_r * d_z
    if owner >= 0:
        weights[1] *= params[_SHARE]
        changes[1] *= params[_SHARE]
        weights[1, owner] += 1.0 - params[_SHARE]
    size = int(params[_TABLE_SIZE])
    table = params[_TABLE : _TABLE + size]
    d = work_array((4, table_channels(table) if size > 0 else 0))
    if size > 0:
        i, i_slope = blend_weight(radius, params[_R_MIN], params[_R_MAX], _EDGE)
        j, j_slope = blend_weight(x[2], params[_Z_MIN], params[_Z_MAX], _EDGE)
        correction(table, angle, i, j, d, jacobian.shape[0] > 0)
        for k in range(d.shape[1]):
            d[2, k] *= i_slope
            d[3, k] *= j_slope
    blend_corrected(params[_TABLE + size :], angle, weights, changes, d, chain, memory, pose, jacobian)


def _mixtures(steps: int) -> tuple[Array, Array]:
    """Places (steps², 2) at equal steps of the corrections' table, as shares of r and z, and weights (steps², 4)."""
    ease, share = eased.py_func, np.linspace(0.0, 1.0, 4001)  # compiling it would take longer than all of this
    nodes = np.interp(np.linspace(0.0, 1.0, steps), [ease(at, _EDGE)[0] for at in share], share)
    z, r = np.meshgrid(nodes, nodes)
    places = np.stack([r.ravel(), z.ravel()], axis=-1)
    a, b = (np.array([ease(at)[0] for at in way]) for way in places.T)
    return places, np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=-1)


def correction_shape(limbs: int) -> tuple[int, int]:
    """Shape of a map's corrections at one place of the lap: how many mixtures it has, and channels of so many limbs."""
    return _NODES**2, ROOT + FOOT * limbs


class Cylindrical(AnimationMap):
    r"""Four clips round a cylinder about the z axis of H.

    θ = atan2(y, x) is the phase: one lap of the hand is one lap of every clip. The weights w_i(r, z) blend the four
    clips bilinearly and ease in at the edges (C²); beyond them they stay, so no limb is ever extrapolated. How poses
    are blended is told in `blending`. With limbs, in-betweens are corrected by a table (`inbetween`): ends move while
    they are lifted, one at a time (`footfalls`), and the root may sway (`with_sway`).

    Clips that step differently have no mean that steps: a foot that one of them plants, another one lifts. With `upper`
    joints only these are blended; root and legs are those of one clip everywhere, and so are its feet. Where it bears
    no more, only a share λ of the others' joints is blended into its own: weights are λ w_i + (1 − λ) of that clip.

    A ∈ SE(2) is the frame of the lap, kept in the memory: it moves by exp(Σ w_i ξ_i) each time the hand goes over
    the seam θ = 0 forwards, and back backwards, so the figure walks on. Pose, velocity and acceleration are
    continuous over the seam. If no clip travels or turns, A stays the identity and h is a function of the stylus
    position alone. h does not depend on the stylus orientation. On the axis r = 0 the phase, hence h, is not defined.

    Parameters
    ----------
    clips : sequence of four (Array, float)
        Poses (n, nq) and frames per second: at (r_min, z_min), (r_max, z_min), (r_min, z_max), (r_max, z_max). A
        pose is root position, root quaternion, then joint quaternions (wxyz). Clips that do not close are closed
        (`closed_loop`), and all are aligned to the first in time (`alignment`).
    r_range, z_range : tuple of two floats
        Intervals [m] over which the clips blend; r_min > 0.
    limbs : sequence of Limb
        Limbs whose ends are to be where they are in the clips on average: feet that stand (see `limbs`).
    corrections : Array, shape (n, k, 2 + 4 limbs), optional
        What a map of the same clips, limbs and lap has as its `corrections`, which then need not be found again.
    lap : float, optional
        Time of the hand's lap [s], in which each clip is played as often as it fits (`strides`); without it, once.
    upper : sequence of int
        Joints that alone are blended, counted from 1; by default all.
    legs_of : int
        With `upper`, the clip whose legs and root they are, counted from 0.

    Attributes
    ----------
    mixtures : Array, shape (k, 4)
        Weights of the clips at the nodes of the table.
    corrections : Array, shape (n, k, 2 + 4 limbs)
        Of the ends at the mixtures, at equal steps of the lap; none without limbs.
    drifts : Array, shape (4, 3)
        ξ of each clip.
    share : float
        λ (see `with_share`).

    Raises
    ------
    ParameterError
        If there are not four clips of the same kind of pose, an interval is empty, or a limb is not one of the pose's.
    """

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
        numbers = (*checked_interval("r_range", r_range, 1e-3), *checked_interval("z_range", z_range, -np.inf))
        if not 0 <= legs_of < _CLIPS:
            raise ParameterError(f"legs are of clip 0 to {_CLIPS - 1}, got {legs_of}")
        self.upper, self.legs_of, self.share = tuple(upper), legs_of, 1.0
        legs = 1.0 + legs_of if self.upper else 0.0
        super().__init__(CYLINDRICAL, cylindrical_map, clips, (*numbers, legs, 1.0, 0.0), upper, limbs, lap,
                         len(self.upper) > 0)  # fmt: skip
        self._numbers = numbers
        self._nodes, self.mixtures = _mixtures(_NODES)
        self.drifts: Array = np.stack([loop.drift for loop in self.loops])
        self.corrections: Array = np.empty((0, len(self.mixtures), ROOT))
        if limbs:
            self._correct(self._found(limbs) if corrections is None else corrections)

    def _found(self, limbs: Sequence[Limb]) -> Array:
        if self.upper:
            return np.zeros((_ROWS, *correction_shape(len(limbs))))
        rows = int(np.clip(max(loop.share * len(loop.splines[0].x) for loop in self.loops), 64, _ROWS))
        channels = with_ends(aligned_channels(self.loops, rows, limbs), self.drifts, limbs)
        found = foot_corrections(channels, self.drifts, limbs, self.mixtures)
        share = interpolation(_NODES, np.linspace(0.0, 1.0, _BETWEEN))
        shares = np.einsum("ai,bj->abij", share, share).reshape(_BETWEEN**2, _NODES**2)
        return cleared(found, channels, self.drifts, limbs, self.mixtures, _mixtures(_BETWEEN)[1], shares)

    def _correct(self, values: Array) -> None:
        table = packed_table(values.reshape(len(values), _NODES, _NODES, -1))
        blend = self._params[_TABLE + int(self._params[_TABLE_SIZE]) :]
        self._params = np.concatenate([self._params[:_TABLE_SIZE], [len(table)], table, blend])
        self.corrections = values

    @property
    def remarks(self) -> tuple[str, ...]:
        """Whether only some joints are blended."""
        if not self.upper:
            return ()
        owner = _ORDINALS[self.legs_of]
        told = f"the clips move differently: a mean of them is no motion, so legs and trunk are the {owner} clip's"
        if self.share < 1.0:
            told += f", which bear {100 * self.share:.0f} % of the others' arms"
        return (told,)

    def places(self, angles: Array) -> Array:
        """Stylus poses, upright, at which the weights are those of the mixtures, at angles θ (n,): shape (k, n, 7)."""
        r_min, r_max, z_min, z_max = self._numbers
        r, z = r_min + self._nodes[:, 0] * (r_max - r_min), z_min + self._nodes[:, 1] * (z_max - z_min)
        x = np.zeros((len(r), len(angles), 7))
        x[..., 0], x[..., 1] = r[:, None] * np.cos(angles), r[:, None] * np.sin(angles)
        x[..., 2], x[..., 3] = z[:, None], 1.0
        return x

    def with_sway(self, sway: Array) -> "Cylindrical":
        """The same map, its root moved at the mixtures.

        Parameters
        ----------
        sway : Array, shape (n, k, 2)
            At equal steps of the lap [m], in the frame of the lap's drift.
        """
        other = copy(self)
        values = self.corrections.copy()
        rows = len(values)
        values[..., :ROOT] = np.fft.irfft(np.fft.rfft(sway, axis=0) * (rows / len(sway)), rows, axis=0)
        other._correct(values)
        return other

    def with_share(self, share: float) -> "Cylindrical":
        """The same map with another share λ of other clips' joints: 0 leaves them to the clip whose legs they are.

        Raises
        ------
        ParameterError
            If it is not from 0 to 1, or all joints are blended.
        """
        if not (self.upper and 0.0 <= share <= 1.0):
            raise ParameterError(f"a map with legs of one clip takes a share of other joints from 0 to 1, got {share}")
        other = copy(self)
        other._params = self._params.copy()
        other._params[_SHARE] = other.share = share
        return other

    def arrays(self) -> dict[str, Array]:
        """The map as arrays by key; `from_arrays` makes the same map of them, to the last bit."""
        arrays = {"domain": np.array([self.r_range, self.z_range])}
        if self.upper:
            arrays["upper_joints"] = np.array(self.upper, dtype=np.float64)
            arrays["legs_of"], arrays["share"] = np.array([float(self.legs_of)]), np.array([self.share])
        if self.limbs:
            arrays["corrections"] = self.corrections
        return arrays | self.lap_array() | clip_arrays(self.clips, self.names, self.limbs)

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> "Cylindrical":
        """Map of what `arrays` gave.

        Raises
        ------
        ParameterError
            If an array is missing, or they make no map.
        """
        (r_low, r_high), (z_low, z_high) = kept(arrays, "domain", (2, 2)).tolist()
        limbs, corrections = kept_limbs(arrays), None
        if limbs:
            corrections = kept(arrays, "corrections", (None, *correction_shape(len(limbs))))
        upper = kept(arrays, "upper_joints", (None,)) if "upper_joints" in arrays else np.zeros(0)
        if not np.isfinite(upper).all():
            raise ParameterError(f"'upper_joints' of the map must be finite, got {upper}")
        clips, joints = kept_clips(arrays), [int(joint) for joint in upper]
        owner = int(kept(arrays, "legs_of", (1,))[0]) if "legs_of" in arrays else 0
        share = float(kept(arrays, "share", (1,))[0]) if "share" in arrays else 1.0
        made = Cylindrical(
            clips, (r_low, r_high), (z_low, z_high), limbs, corrections, kept_lap(arrays), joints, owner
        )  # fmt: skip
        return made.with_share(share) if joints else made
