"""The cylindrical map: an angle is the frame, radius and height blend four clips (Donald & Henle 2000, Fig. 3)."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT, CompiledMap, HapticMap
from controllers.haptic_map.blending import blend, fresh_lap, packed_blend
from controllers.haptic_map.limbs import Limb
from controllers.haptic_map.loops import Loop, checked_clip, closed_loop
from controllers.state import Array, Pose

CYLINDRICAL = 1
_CLIPS = 4
_R_MIN, _R_MAX, _Z_MIN, _Z_MAX, _BLEND = range(5)

_MARGIN = 0.15  # share of the interval at each edge over which the blend eases in
_AXIS = 1e-3  # [m] nearer to the axis the derivative stops growing


@njit
def eased(s: float) -> tuple[float, float]:
    """Blend weight u(s) and u': 0 below 0, 1 above 1, linear between but for the eased edges; C²."""
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0
    slope = 1.0 / (1.0 - _MARGIN)
    edge = min(s, 1.0 - s) / _MARGIN
    if edge >= 1.0:
        return slope * (s - 0.5 * _MARGIN), slope
    # Integral of the smooth step 3x² − 2x³.
    u = slope * _MARGIN * (edge**3 - 0.5 * edge**4)
    return (u if s < 0.5 else 1.0 - u), slope * edge * edge * (3.0 - 2.0 * edge)


@njit
def cylindrical_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Cylindrical`: h(x), and h_*(x) unless `jacobian` has no rows."""
    radius = np.sqrt(x[0] * x[0] + x[1] * x[1])
    angle = np.arctan2(x[1], x[0])
    if angle < 0.0:
        angle = min(angle + 2.0 * np.pi, 2.0 * np.pi)
    a, a_slope = eased((radius - params[_R_MIN]) / (params[_R_MAX] - params[_R_MIN]))
    b, b_slope = eased((x[2] - params[_Z_MIN]) / (params[_Z_MAX] - params[_Z_MIN]))
    a_slope /= params[_R_MAX] - params[_R_MIN]
    b_slope /= params[_Z_MAX] - params[_Z_MIN]
    weights, changes = np.empty((1, _CLIPS)), np.empty((1, 2, _CLIPS))
    for i in range(_CLIPS):
        w_r, d_r = (a, a_slope) if i % 2 == 1 else (1.0 - a, -a_slope)
        w_z, d_z = (b, b_slope) if i >= 2 else (1.0 - b, -b_slope)
        weights[0, i], changes[0, 0, i], changes[0, 1, i] = w_r * w_z, d_r * w_z, w_r * d_z
    inside = max(radius, _AXIS)
    chain = np.zeros((3, 6))
    chain[0, 0], chain[0, 1] = -x[1] / (inside * inside), x[0] / (inside * inside)
    chain[1, 0], chain[1, 1] = x[0] / inside, x[1] / inside
    chain[2, 2] = 1.0
    blend(params[_BLEND:], angle, weights, changes, chain, memory, pose, jacobian)


class Cylindrical(HapticMap):
    r"""Four clips round a cylinder about the z axis of H.

    θ = atan2(y, x) is the phase: one lap of the hand is one lap of every clip. The weights w_i(r, z) blend the four
    clips bilinearly and ease in at the edges (C²); beyond them they stay, so no limb is ever extrapolated. How poses
    are blended is told in `blending`.

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
    ) -> None:
        if len(clips) != _CLIPS:
            raise ParameterError(
                f"the cylindrical map blends {_CLIPS} clips, got {len(clips)}; give one more than once"
            )
        poses = [checked_clip(clip, fps, f"clip {i}") for i, (clip, fps) in enumerate(clips)]
        if len({clip.shape[1] for clip in poses}) != 1:
            raise ParameterError(f"all clips must have poses of the same size, got {[clip.shape[1] for clip in poses]}")
        for name, (low, high), least in (("r_range", r_range, 1e-3), ("z_range", z_range, -np.inf)):
            if not (least < low < high < np.inf):
                raise ParameterError(
                    f"{name} must increase{' from 1 mm or more' * (name == 'r_range')}, got {low, high} m"
                )
        self.loops: list[Loop] = [closed_loop(clip, fps) for clip, (_, fps) in zip(poses, clips, strict=True)]
        self.r_range, self.z_range = r_range, z_range
        samples = int(np.clip(max(len(clip) for clip in poses) - 1, 64, 2048))
        self._nq = poses[0].shape[1]
        groups = np.zeros((self._nq - 3) // 4, dtype=np.int64)
        self._params = np.concatenate([r_range, z_range, packed_blend(self.loops, samples, groups, limbs)])

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return self._nq

    @property
    def nv(self) -> int:
        """Numbers of a tangent: root velocity in the world; angular velocity of root and joints in their own frames."""
        return 6 + 3 * ((self._nq - 7) // 4)

    @property
    def lap_seconds(self) -> float:
        """Time of a lap at which the four clips run, on average, at their own pace [s]."""
        return float(np.mean([loop.duration for loop in self.loops]))

    @property
    def travels(self) -> bool:
        """Whether a lap moves or turns the figure, so that h depends on the laps done."""
        return any(bool(loop.drift.any()) for loop in self.loops)

    def compiled(self) -> CompiledMap:
        """The map as its kernel takes it, with the memory of a new run."""
        return CompiledMap(CYLINDRICAL, self._params, fresh_lap())

    def pose(self, x: Array, memory: Array | None = None) -> Pose:
        """Configuration h(x), shape (nq,), of a stylus pose (7,), in the first lap or the memory's (updated)."""
        return self._evaluate(x, memory, 0)[0]

    def jacobian(self, x: Array, memory: Array | None = None) -> Array:
        """Derivative h_*(x), shape (nv, 6): columns linear, then angular velocity in H; memory as in `pose`."""
        return self._evaluate(x, memory, self.nv)[1]

    def _evaluate(self, x: Array, memory: Array | None, rows: int) -> tuple[Pose, Array]:
        stylus = np.asarray(x, dtype=np.float64)
        if stylus.shape != (STYLUS,):
            raise ParameterError(f"a stylus pose has shape ({STYLUS},), got {stylus.shape}")
        pose, jacobian = np.empty(self.nq), np.empty((rows, STYLUS_TANGENT))
        cylindrical_map(self._params, stylus, self.compiled().memory if memory is None else memory, pose, jacobian)
        return pose, jacobian
