"""The lifted map: every clip has its own curve, and the stylus blends the clips of nearby curves (section 8.1)."""

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from controllers.blending.clip_arrays import clip_arrays, stored_array, stored_clips, stored_limbs, stored_names
from controllers.curves.splines import periodic_interpolation
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import ClipMap, arms_of_others
from controllers.haptic_map.lifted_kernel import clip_weights, lifted_map, packed_lifted, with_legs_of
from controllers.haptic_map.lifting.frames import PlacedClip, checked_angles, closing_gap
from controllers.haptic_map.lifting.sites import checked_sites
from controllers.haptic_map.lifting.transitions import MapTransition, checked_transitions, transition_rows
from controllers.legs.limbs import Limb
from controllers.legs.stance_hold import fresh_footing
from controllers.motion.loops import MAX_CLOSURE_GAP, checked_clip
from geometry.arrays import Array


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
    (`stance_hold`).

    Neighbouring motions are seldom alike: a hand that is pushed from a walk onto a kick would require the figure to
    kick within a tenth of a second. `with_legs_of` takes root, legs and trunk from one clip, as `Cylindrical` does, and
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
        Limbs whose ends (feet) are placed at the mean of their positions in the clips (see `limb_kinematics`).
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
        Clip that gives root, legs and trunk (see `with_legs_of`); None if all joints are blended.
    share : float
        λ.

    Raises
    ------
    ParameterError
        If clips, angles, sites and names do not fit each other, a clip given as closed does not close, a site comes
        too near to the axis, or two sites too near to each other.
    """

    map_kernel = staticmethod(lifted_map)

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
        self._placed_clips = tuple(_place_clip(*values) for values in zip(names, clips, closed, angles, strict=True))
        sizes = [clip.poses.shape[1] for clip in self._placed_clips]
        if len(set(sizes)) != 1:
            raise ParameterError(f"all clips must have poses of one size, got {sizes}")
        self.margin = _checked_margin(margin)
        self.sites = checked_sites(sites, names, self.margin)
        self.transitions = checked_transitions(transitions, m)
        self.legs_of: int | None = None
        self.share = 1.0
        limbs = [limb.with_limits_for([clip.poses for clip in self._placed_clips]) for limb in limbs]
        params = packed_lifted(self._placed_clips, self.sites, self.margin, limbs)
        super().__init__(params, clips, limbs)
        self.names = names

    def fresh_memory(self) -> Array:
        """As in `ClipMap`, and a footing."""
        return np.concatenate([super().fresh_memory(), fresh_footing(len(self.limbs))])

    @property
    def closed(self) -> tuple[bool, ...]:
        """Whether each clip is closed."""
        return tuple(clip.closed for clip in self._placed_clips)

    @property
    def angles(self) -> tuple[Array, ...]:
        """θ_i(t_k) of each clip [rad]."""
        return tuple(clip.angles for clip in self._placed_clips)

    def placed(self, i: int) -> Array:
        """Poses of clip i (n, nq) after its displacement to the origin: h along its curve, from the first lap on."""
        return self._placed_clips[i].poses.copy()

    def site(self, i: int, angles: Array) -> Array:
        """q_i = (r, z) [m] of curve i at angles (...), shape (..., 2)."""
        return periodic_interpolation(self.sites[:, i], angles)

    def curve_point(self, i: int, angle: float) -> Array:
        """Point [m] of curve i at an angle of the lap, shape (3,)."""
        r, z = self.site(i, np.array(angle))
        return np.array([r * np.cos(angle), r * np.sin(angle), z])

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
        _, count = clip_weights(self._params, np.asarray(x, dtype=np.float64), np.empty((3, 6)), near, w, changes)
        result[near[:count]] = w[:count]
        return result

    @property
    def remarks(self) -> tuple[str, ...]:
        """A remark if only some joints are blended."""
        if self.legs_of is None:
            return ()
        owner, arms = self.names[self.legs_of], arms_of_others(self.share)
        return (f"legs and trunk are those of {owner} wherever the hand is pushed, with {arms}",)

    def with_legs_of(self, clip: int, upper: Sequence[int], share: float) -> "Lifted":
        """The same map with root and all joints but `upper` (counted from 1) from one clip, and a share λ of the rest.

        Raises
        ------
        ParameterError
            If there is no such clip, a joint is not in the poses or belongs to a limb, or the share is not in [0, 1].
        """
        joints = (self.nq - 3) // 4
        legs = {joint for limb in self.limbs for joint in limb.joints}
        if not (0 <= clip < len(self.names) and 0.0 <= share <= 1.0 and set(upper) <= {*range(1, joints)} - legs):
            raise ParameterError(
                f"a lifted map takes the legs of clip 0 to {len(self.names) - 1}, other joints from 1 to "
                f"{joints - 1} that are no limb's, and a share from 0 to 1; got {clip}, {list(upper)} and {share}"
            )
        other = copy(self)
        other._params = with_legs_of(self._params, clip, upper, share)
        other.legs_of, other.share = clip, share
        return other

    def arrays(self) -> dict[str, Array]:
        """The map as arrays by key; `from_arrays` restores it from them bit for bit, with all joints blended."""
        arrays = {
            "sites": self.sites,
            "margin": np.array([self.margin]),
            "transitions": transition_rows(self.transitions),
        }
        for name, clip in zip(self.names, self._placed_clips, strict=True):
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
        names = stored_names(arrays)
        return Lifted(
            stored_clips(arrays),
            [_checked_flag(f"closed/{name}", float(stored_array(arrays, f"closed/{name}", (1,))[0])) for name in names],
            [stored_array(arrays, f"angles/{name}", (None,)) for name in names],
            stored_array(arrays, "sites", (None, None, 2)),
            stored_limbs(arrays),
            names,
            float(stored_array(arrays, "margin", (1,))[0]),
            stored_array(arrays, "transitions", (None, 5)),
        )


def _checked_flag(name: str, value: float) -> bool:
    if value not in (0.0, 1.0):
        raise ParameterError(f"{name} is {value}; expected 0 or 1")
    return bool(value)


def _place_clip(name: str, clip: tuple[Array, float], closed: bool, angles: Array) -> PlacedClip:
    poses = checked_clip(*clip, f"clip {name}")
    checked = checked_angles(angles, len(poses), closed, f"clip {name}")
    gap = closing_gap(poses) if closed else 0.0
    if gap > MAX_CLOSURE_GAP:
        raise ParameterError(
            f"clip {name} is to be closed, but its last frame is {gap:.3g} from its first one moved over the ground; "
            "give it as open, or cut it where it repeats"
        )
    return PlacedClip.of(poses, checked, closed)


def _checked_margin(margin: float) -> float:
    if not (np.isfinite(margin) and margin >= 1e-4):
        raise ParameterError(f"the margin of a lifted map must be 1e-4 m or more and finite, got {margin}")
    return float(margin)
