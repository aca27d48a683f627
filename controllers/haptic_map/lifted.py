"""The lifted map: every clip has its own curve, and the stylus blends the clips of nearby curves (section 8.1)."""

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np
from numba import njit

from controllers.blending.clip_arrays import clip_arrays, kept, kept_clips, kept_limbs, kept_names
from controllers.blending.combination import (
    combine,
    figure_channels,
    figure_limbs,
    fresh_lap,
    packed_figure,
    weight_groups,
)
from controllers.blending.pair_corrections import neighbouring_pairs, packed_pairs, pair_channels, pair_correction
from controllers.curves.cylinder import cylinder
from controllers.curves.splines import basis, basis_slope, control_points, round_lap
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.lifting.cores import draw_in
from controllers.haptic_map.lifting.frames import (
    CLOSES,
    PlacedClip,
    checked_angles,
    closing_gap,
    frames_at,
    interpolate_frames,
    lap_spline,
    packed_frames,
)
from controllers.haptic_map.lifting.neighbours import SITE, near_clips, near_weights, packed_neighbours
from controllers.haptic_map.lifting.sites import box, checked_sites
from controllers.haptic_map.lifting.transitions import MapTransition, checked_transitions, transition_rows
from controllers.legs.floor import SOFTNESS
from controllers.legs.footing import fresh_footing, packed_soles
from controllers.legs.limb_ends import end_channels, end_lag, end_poses, grounds, lowest_of_limbs
from controllers.legs.limbs import END, Limb
from controllers.motion.channels import normalise
from controllers.motion.lap import MEMORY
from controllers.motion.loops import checked_clip
from controllers.saturation import clamped
from controllers.state import Array, IntArray
from controllers.work_array import work_array, work_integers

LIFTED = 3

_LAGS = 128  # samples of λ round the lap
_ROWS = 256  # largest number of rows of the corrections' table round the lap
_PAIR_STEPS = 24  # phases of the lap at which neighbouring clips are searched
(
    _R_LOW, _R_HIGH, _Z_LOW, _Z_HIGH, _MARGIN, _CLIPS, _OWN_LEGS, _SHARE, _LAG_AT, _DRIFTS_AT, _FRAMES_AT, _NEAR_AT,
    _PAIRS_AT, _SOLES_AT, _FIGURE,
) = range(15)  # fmt: skip
_NOBODYS = 0.0  # in place of 1 + the number of the clip that gives the legs: all joints are blended


@njit
def _lags(control: Array, limbs: int, angle: float, channels: int, value: Array, slope: Array) -> None:
    """Write λ of each limb, which all clips share, into the channels of the first clip."""
    s = angle * _LAGS / (2.0 * np.pi)
    row = min(int(s), _LAGS - 1)
    b0, b1, b2, b3 = basis(s - row)
    c0, c1, c2, c3 = basis_slope(s - row)
    for n in range(limbs):
        v0, v1 = control[row * limbs + n], control[(row + 1) * limbs + n]
        v2, v3 = control[(row + 2) * limbs + n], control[(row + 3) * limbs + n]
        k = channels - END * (limbs - n) + 3
        value[0, k] = b0 * v0 + b1 * v1 + b2 * v2 + b3 * v3
        slope[0, k] = _LAGS / (2.0 * np.pi) * (c0 * v0 + c1 * v1 + c2 * v2 + c3 * v3)


@njit
def _weigh(params: Array, x: Array, chain: Array, near: IntArray, w: Array, changes: Array) -> tuple[float, int]:
    """Angle of the hand and number of nearby clips; writes `near`, weights w and their derivatives `changes` (3, m)."""
    radius, angle = cylinder(x, chain)
    r, r_slope = clamped(radius, params[_R_LOW], params[_R_HIGH], params[_MARGIN])
    z, z_slope = clamped(x[2], params[_Z_LOW], params[_Z_HIGH], params[_MARGIN])
    for k in range(6):
        chain[1, k] *= r_slope
        chain[2, k] *= z_slope
    total = near.shape[0]
    sites, slopes = work_array((total, SITE)), work_array((total, SITE))
    neighbours = params[int(params[_NEAR_AT]) :]
    count = near_clips(neighbours, angle, r, z, near, sites, slopes)
    place, change = work_array(2), work_array((3, 2))
    if not draw_in(r, z, sites[:count], slopes[:count], place, change):
        near_weights(neighbours, r, z, sites[:count], slopes[:count], w[:count], changes[:, :count])
        return angle, count
    count = near_clips(neighbours, angle, place[0], place[1], near, sites, slopes)
    near_weights(neighbours, place[0], place[1], sites[:count], slopes[:count], w[:count], changes[:, :count])
    for i in range(count):
        by_r, by_z = changes[1, i], changes[2, i]
        changes[0, i] += by_r * change[0, 0] + by_z * change[0, 1]
        for way in (1, 2):
            changes[way, i] = by_r * change[way, 0] + by_z * change[way, 1]
    return angle, count


@njit
def _give_legs(owner: int, share: float, near: IntArray, count: int, w: Array, changes: Array) -> int:
    """Weights of two groups from those of the second: the first is the owner's, of the second it gets 1 − λ more.

    Returns the number of clips, which counts the owner though it may be far from the hand.
    """
    at = 0
    while at < count and near[at] != owner:
        at += 1
    if at == count:
        near[at], w[1, at], count = owner, 0.0, count + 1
        for way in range(3):
            changes[1, way, at] = 0.0
    for i in range(count):
        w[0, i] = 0.0
        w[1, i] *= share
        for way in range(3):
            changes[0, way, i] = 0.0
            changes[1, way, i] *= share
    w[0, at] = 1.0
    w[1, at] += 1.0 - share
    return count


@njit
def lifted_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Lifted`: h(x), and h_*(x) unless `jacobian` has no rows."""
    total, chain, owner = int(params[_CLIPS]), work_array((3, 6)), int(params[_OWN_LEGS]) - 1
    groups = 2 if owner >= 0 else 1  # the last group has the weights of the hand's place
    near, w, changes = work_integers(total), work_array((groups, total)), work_array((groups, 3, total))
    angle, count = _weigh(params, x, chain, near, w[groups - 1], changes[groups - 1])
    if owner >= 0:
        count = _give_legs(owner, params[_SHARE], near, count, w, changes)
    figure = params[_FIGURE:]
    channels = figure_channels(figure)
    value, slope, drifts = work_array((count, channels)), work_array((count, channels)), work_array((count, 3))
    frames = params[int(params[_FRAMES_AT]) :]
    for i in range(count):
        interpolate_frames(frames, near[i], angle, value[i], slope[i])
        for k in range(3):
            drifts[i, k] = params[int(params[_DRIFTS_AT]) + 3 * near[i] + k]
    limbs = figure_limbs(figure)
    _lags(params[int(params[_LAG_AT]) :], limbs, angle, channels, value, slope)
    pairs = params[int(params[_PAIRS_AT]) :]
    d = work_array((4, pair_channels(pairs)))
    if d.shape[1] > 0:
        pair_correction(pairs, angle, near[:count], w[0, :count], changes[0, :, :count], d)
    ground, at = 0.0, int(params[_SOLES_AT])
    for i in range(count):
        ground += w[0, i] * params[at + 1 + near[i]]
    soles = params[at + 1 + total :].reshape(limbs, -1, 3) if limbs > 0 else work_array((0, 0, 3))
    combine(
        figure, value, slope, drifts, angle, w[:, :count], changes[:, :, :count], d, chain, memory[:MEMORY],
        memory[MEMORY:], soles, ground, params[at], pose, jacobian,
    )  # fmt: skip


class Lifted(ClipMap):
    r"""Clips α_i lifted to curves α̃_i round the z axis of H, and one smooth map with h∘α̃_i = α_i at every frame.

    .. math:: \tilde\alpha_i(t_k) = (r_i(\theta)\cos\theta,\; r_i(\theta)\sin\theta,\; z_i(\theta)),
              \qquad \theta = \theta_i(t_k)

    θ = atan2(y, x) is the phase. In the half plane (r, z) at θ each clip has a site q_i = (r_i, z_i), a periodic C²
    spline of θ. The pose is the mean of the nearby clips with the weights of `neighbours`; each clip contributes its
    pose at θ by splines with a knot at every frame (`frames`). On its own curve a clip has all the weight, in its core
    (`cores`) nearly all, and its poses are exact up to the displacement over the ground that moved the clip to the
    origin (`placed`). `combination` describes the blend and the frame A of the lap; a closed clip whose angles begin at
    θ₀ > 0 has its frames beyond 2π in the next lap.

    With limbs, in-betweens of neighbours are corrected (`pair_corrections`): feet move one at a time, while they are
    lifted. They stay above the floor (`floor`), and in stance they keep their place while the mixture changes
    (`footing`).

    Motions side by side are seldom alike: a hand that is pushed from a walk onto a kick would ask the figure to kick
    within a tenth of a second. `with_legs_of` leaves root, legs and trunk to one clip, as `Cylindrical` does, and
    blends only a share λ of the other joints.

    h is C² except on the axis r = 0, where the phase is not defined. Outside the box round all sites r and z are
    clamped to it, smoothly (C²) over a margin: no limb is extrapolated. h does not depend on the stylus orientation.

    Parameters
    ----------
    clips : sequence of (Array, float)
        Poses (n, nq) and frames per second, as in `Cylindrical`.
    closed : sequence of bool
        Whether each clip's last frame equals its first up to a displacement over the ground.
    angles : sequence of Array
        θ_i(t_k) [rad], shape (n,), increasing: from some θ₀ in [0, 2π) once round for a closed clip; within [0, 2π],
        leaving a gap, for an open one.
    sites : Array, shape (rows, m, 2)
        (r_i, z_i) [m] at `rows` equal steps of a lap.
    limbs : sequence of Limb
        Limbs whose ends (feet) are placed at the mean of their positions in the clips (see `limbs`).
    names : sequence of str, optional
        Names of the clips; by default their numbers.
    margin : float
        Margin of the clamping [m].
    transitions : sequence of MapTransition, or Array of shape (k, 5)
        Where a hand may change between clips, the best first. Stored with the map; h does not depend on them.

    Attributes
    ----------
    transitions : tuple of MapTransition
        As given.
    legs_of : int or None
        Clip that gives root, legs and trunk (see `with_legs_of`); None where all is blended.
    share : float
        λ.

    Raises
    ------
    ParameterError
        If clips, angles, sites and names do not fit each other, a clip given as closed does not close, a site comes
        too near to the axis, or two sites too near to each other.
    """

    def __init__(
        self,
        clips: Sequence[tuple[Array, float]],
        closed: Sequence[bool],
        angles: Sequence[Array],
        sites: Array,
        limbs: Sequence[Limb] = (),
        names: Sequence[str] = (),
        margin: float = 4e-3,
        transitions: Sequence[MapTransition] | Array = (),
    ) -> None:
        m = len(clips)
        names = tuple(names) or tuple(str(i) for i in range(m))
        if m < 1 or {len(closed), len(angles), len(names)} != {m} or len(set(names)) != m:
            raise ParameterError(
                f"a lifted map takes one or more clips, each with closed, angles and a name of its own; got {m} clips, "
                f"{len(closed)} closed, {len(angles)} angles, the names {', '.join(names)}"
            )
        self._placed = tuple(_placed_clip(*values) for values in zip(names, clips, closed, angles, strict=True))
        sizes = [clip.poses.shape[1] for clip in self._placed]
        if len(set(sizes)) != 1:
            raise ParameterError(f"all clips must have poses of one size, got {sizes}")
        self.margin = _checked_margin(margin)
        self.sites = checked_sites(sites, names, self.margin)
        self.transitions = checked_transitions(transitions, m)
        self.legs_of: int | None = None
        self.share = 1.0
        limbs = [limb.allowing([clip.poses for clip in self._placed]) for limb in limbs]
        super().__init__(LIFTED, lifted_map, self._packed(limbs), clips, names, limbs)

    @property
    def _drifts(self) -> Array:
        return np.stack([clip.drift for clip in self._placed])

    def compiled(self) -> CompiledMap:
        """The map in the form of its kernel, with the memory of a new run."""
        return CompiledMap(LIFTED, self._params, np.concatenate([fresh_lap(), fresh_footing(len(self.limbs))]))

    @property
    def closed(self) -> tuple[bool, ...]:
        """Whether each clip is closed."""
        return tuple(clip.closed for clip in self._placed)

    @property
    def angles(self) -> tuple[Array, ...]:
        """θ_i(t_k) of each clip [rad]."""
        return tuple(clip.angles for clip in self._placed)

    def placed(self, i: int) -> Array:
        """Poses of clip i (n, nq) after its displacement to the origin: h along its curve, from the first lap on."""
        return self._placed[i].poses.copy()

    def site(self, i: int, angles: Array) -> Array:
        """q_i = (r, z) [m] of curve i at angles (...), shape (..., 2)."""
        return round_lap(self.sites[:, i], angles)

    def curve(self, i: int) -> Trajectory:
        """α̃_i with the timing of the clip, periodic if the clip is closed; exact at the frames."""
        angles = self.angles[i]
        q = self.site(i, angles)
        points = np.column_stack([q[:, 0] * np.cos(angles), q[:, 0] * np.sin(angles), q[:, 1]])
        if self.closed[i]:
            points[-1] = points[0]
        return Trajectory(np.arange(len(points)) / self.clips[i][1], points, periodic=self.closed[i])

    def weights(self, x: Array) -> Array:
        """Weights w_i (m,) of the clips at a stylus pose (7,); their sum is 1."""
        m = len(self.clips)
        near, w, changes, result = np.empty(m, dtype=np.int64), np.empty(m), np.empty((3, m)), np.zeros(m)
        _, count = _weigh(self._params, np.asarray(x, dtype=np.float64), np.empty((3, 6)), near, w, changes)
        result[near[:count]] = w[:count]
        return result

    @property
    def remarks(self) -> tuple[str, ...]:
        """Says so if only some joints are blended."""
        if self.legs_of is None:
            return ()
        owner, arms = self.names[self.legs_of], "the others' arms"
        bears = arms if self.share == 1.0 else f"{100 * self.share:.0f} % of {arms}"
        return (f"legs and trunk are those of {owner} wherever the hand is pushed, which bear {bears}",)

    def with_legs_of(self, clip: int, upper: Sequence[int], share: float) -> "Lifted":
        """The same map with root and all joints but `upper` (counted from 1) from one clip, and a share λ of the rest.

        Raises
        ------
        ParameterError
            If there is no such clip, a joint is none of the poses' or a limb's, or the share is not from 0 to 1.
        """
        other = copy(self)
        other._params = self._params.copy()
        groups = weight_groups(other._params[_FIGURE:])
        taken = {joint for limb in self.limbs for joint in limb.joints}
        if not (0 <= clip < len(self.names) and 0.0 <= share <= 1.0 and set(upper) <= {*range(1, len(groups))} - taken):
            raise ParameterError(
                f"a lifted map takes the legs of clip 0 to {len(self.names) - 1}, other joints from 1 to "
                f"{len(groups) - 1} that are no limb's, and a share from 0 to 1; got {clip}, {list(upper)} and {share}"
            )
        groups[:] = np.isin(np.arange(len(groups)), upper)
        other._params[_OWN_LEGS], other._params[_SHARE] = 1.0 + clip, share
        other.legs_of, other.share = clip, share
        return other

    def arrays(self) -> dict[str, Array]:
        """The map as arrays by key; `from_arrays` restores it from them bit for bit, with all joints blended."""
        arrays = {
            "sites": self.sites,
            "margin": np.array([self.margin]),
            "transitions": transition_rows(self.transitions),
        }
        for name, clip in zip(self.names, self._placed, strict=True):
            arrays |= {f"angles/{name}": clip.angles, f"closed/{name}": np.array([float(clip.closed)])}
        return arrays | clip_arrays(self.clips, self.names, self.limbs)

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> "Lifted":
        """Map restored from the output of `arrays`.

        Raises
        ------
        ParameterError
            If an array is missing, or its values are not those of a map.
        """
        names = kept_names(arrays)
        return Lifted(
            kept_clips(arrays),
            [_flag(f"closed/{name}", float(kept(arrays, f"closed/{name}", (1,))[0])) for name in names],
            [kept(arrays, f"angles/{name}", (None,)) for name in names],
            kept(arrays, "sites", (None, None, 2)),
            kept_limbs(arrays),
            names,
            float(kept(arrays, "margin", (1,))[0]),
            kept(arrays, "transitions", (None, 5)),
        )

    def _packed(self, limbs: Sequence[Limb]) -> Array:
        drifts, rotations = self._drifts, (self._placed[0].poses.shape[1] - 3) // 4
        lags = self._common_lags(rotations, limbs)
        channels = list[Array]()
        for clip, drift in zip(self._placed, drifts, strict=True):
            result, ends = clip.remainder[:, None], list[Array]()
            rest, lag = result.copy(), round_lap(lags, clip.angles)
            for n, limb in enumerate(limbs):
                quaternions, end = end_channels(rest, drift[None], limb, lag[:, n])
                result[..., 3 + 4 * limb.joints[2] : 7 + 4 * limb.joints[2]] = quaternions
                ends.append(end)
            channels.append(np.concatenate([result, *ends], axis=2)[:, 0])
        splines = [
            lap_spline(clip.angles, c, rotations, clip.closed) for clip, c in zip(self._placed, channels, strict=True)
        ]
        low, high = box(self.sites)
        half = 0.5 * self.margin
        blocks = [
            packed_figure(np.zeros(rotations, dtype=np.int64), limbs),
            control_points(lags, np.ones(lags.shape[1:])).ravel(),
            drifts.ravel(),
            packed_frames(splines),
            packed_neighbours(self.sites, (low[0] - half, high[0] + half), (low[1] - half, high[1] + half)),
            self._packed_pairs(splines, lags, limbs),
            self._packed_soles(channels, limbs),
        ]
        at = _FIGURE + np.cumsum([block.size for block in blocks[:-1]])
        numbers = [low[0], high[0], low[1], high[1], self.margin, len(self._placed), _NOBODYS, 1.0, *at]
        return np.concatenate([numbers, *blocks])

    def _packed_soles(self, channels: list[Array], limbs: Sequence[Limb]) -> Array:
        if not limbs:
            return np.zeros(1 + len(channels))
        floor = min(lowest_of_limbs(clip[:, None], limbs, SOFTNESS).min() for clip in channels)
        return np.concatenate([
            [floor], *(grounds(clip[:, None], limbs) for clip in channels), packed_soles(limbs),
        ])  # fmt: skip

    def _packed_pairs(self, splines: list[tuple[Array, Array, Array]], lags: Array, limbs: Sequence[Limb]) -> Array:
        rows = int(np.clip(max(len(clip.poses) for clip in self._placed), 64, _ROWS)) if limbs else 1
        phases = np.arange(rows) * 2.0 * np.pi / rows
        channels = np.stack([frames_at(spline, phases) for spline in splines], axis=1)
        last = channels.shape[2] - END * len(limbs)
        normalise(channels, (last - 3) // 4)
        for n in range(len(limbs)):
            channels[..., last + END * n + 3] = round_lap(lags[:, n], phases)[:, None]
        steps = round_lap(self.sites, np.arange(_PAIR_STEPS) * 2.0 * np.pi / _PAIR_STEPS)
        return packed_pairs(channels, self._drifts, limbs, neighbouring_pairs(steps))

    def _common_lags(self, rotations: int, limbs: Sequence[Limb]) -> Array:
        """λ of each limb at equal steps of the lap, shape (_LAGS, limbs), from all clips."""
        if not self._drifts[:, 2].any() or not limbs:
            return np.zeros((_LAGS, len(limbs)))
        phases = np.arange(_LAGS) * 2.0 * np.pi / _LAGS
        splines = [lap_spline(clip.angles, clip.remainder, rotations, clip.closed) for clip in self._placed]
        channels = np.stack([frames_at(spline, phases) for spline in splines], axis=1)
        return np.stack([end_lag(end_poses(channels, limb)[0], self._drifts) for limb in limbs], axis=1)


def _flag(name: str, value: float) -> bool:
    if value not in (0.0, 1.0):
        raise ParameterError(f"{name} is {value}; expected 0 or 1")
    return bool(value)


def _placed_clip(name: str, clip: tuple[Array, float], closed: bool, angles: Array) -> PlacedClip:
    poses = checked_clip(*clip, f"clip {name}")
    checked = checked_angles(angles, len(poses), closed, f"clip {name}")
    gap = closing_gap(poses) if closed else 0.0
    if gap > CLOSES:
        raise ParameterError(
            f"clip {name} is to be closed, but its last frame is {gap:.3g} from its first one moved over the ground; "
            "give it as open, or cut it where it repeats"
        )
    return PlacedClip.of(poses, checked, closed)


def _checked_margin(margin: float) -> float:
    if not (np.isfinite(margin) and margin >= 1e-4):
        raise ParameterError(f"the margin of a lifted map must be 1e-4 m or more and finite, got {margin}")
    return float(margin)
