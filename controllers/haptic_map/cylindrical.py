"""The cylindrical map: an angle is the frame, radius and height blend four clips (Donald & Henle 2000, Fig. 3)."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.alignment import aligned_channels
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT, CompiledMap, HapticMap
from controllers.haptic_map.ground import Heights, ground_correction, ground_table
from controllers.haptic_map.lap import LAP_HEADING, LAP_X, LAP_Y, LAST_ANGLE, MEMORY, drift_motion, update_lap
from controllers.haptic_map.loops import Loop, checked_clip, closed_loop
from controllers.haptic_map.mean import mean_derivative, mean_rotation
from controllers.haptic_map.splines import basis, basis_slope, control_points
from controllers.rotations import multiply, relative
from controllers.state import Array, Pose

CYLINDRICAL = 1
_CLIPS = 4
_SAMPLES, _CHANNELS, _R_MIN, _R_MAX, _Z_MIN, _Z_MAX, _GROUND, _DRIFT = range(8)
_ROWS = _DRIFT + 3 * _CLIPS

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
def _interpolate(params: Array, angle: float, value: Array, slope: Array) -> None:
    """Channels of each clip and their derivatives by the angle, from uniform cubic B-splines."""
    samples, channels = int(params[_SAMPLES]), int(params[_CHANNELS])
    s = angle * samples / (2.0 * np.pi)
    row = min(int(s), samples - 1)
    b0, b1, b2, b3 = basis(s - row)
    d0, d1, d2, d3 = basis_slope(s - row)
    rate = samples / (2.0 * np.pi)
    stride = _CLIPS * channels
    for clip in range(_CLIPS):
        first = _ROWS + row * stride + clip * channels
        p0, p1 = params[first : first + channels], params[first + stride : first + stride + channels]
        first += 2 * stride
        p2, p3 = params[first : first + channels], params[first + stride : first + stride + channels]
        for k in range(channels):
            value[clip, k] = b0 * p0[k] + b1 * p1[k] + b2 * p2[k] + b3 * p3[k]
            slope[clip, k] = rate * (d0 * p0[k] + d1 * p1[k] + d2 * p2[k] + d3 * p3[k])


@njit
def _unit_rotations(value: Array, slope: Array, column: int, unit: Array, spin: Array) -> None:
    """Quaternions of all clips at a column, normalised, and their local angular velocities 2 Im(q⁻¹ ⊗ ṡ)/|s|."""
    for i in range(_CLIPS):
        q, d = value[i, column : column + 4], slope[i, column : column + 4]
        scale = 1.0 / np.sqrt(max(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1e-12))
        for j in range(4):
            unit[i, j] = scale * q[j]
        _, x, y, z = relative(unit[i, 0], unit[i, 1], unit[i, 2], unit[i, 3], d[0], d[1], d[2], d[3])
        spin[i, 0], spin[i, 1], spin[i, 2] = 2.0 * scale * x, 2.0 * scale * y, 2.0 * scale * z


@njit
def cylindrical_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Cylindrical`: h(x), and h_*(x) unless `jacobian` has no rows; memory [x, y, heading, last θ, laps]."""
    radius = np.sqrt(x[0] * x[0] + x[1] * x[1])
    angle = np.arctan2(x[1], x[0])
    if angle < 0.0:
        angle = min(angle + 2.0 * np.pi, 2.0 * np.pi)
    a, a_slope = eased((radius - params[_R_MIN]) / (params[_R_MAX] - params[_R_MIN]))
    b, b_slope = eased((x[2] - params[_Z_MIN]) / (params[_Z_MAX] - params[_Z_MIN]))
    a_slope /= params[_R_MAX] - params[_R_MIN]
    b_slope /= params[_Z_MAX] - params[_Z_MIN]
    weights, changes = np.empty(_CLIPS), np.empty((2, _CLIPS))
    for i in range(_CLIPS):
        w_r, d_r = (a, a_slope) if i % 2 == 1 else (1.0 - a, -a_slope)
        w_z, d_z = (b, b_slope) if i >= 2 else (1.0 - b, -b_slope)
        weights[i], changes[0, i], changes[1, i] = w_r * w_z, d_r * w_z, w_r * d_z

    channels = int(params[_CHANNELS])
    value, slope = np.empty((_CLIPS, channels)), np.empty((_CLIPS, channels))
    _interpolate(params, angle, value, slope)

    # Drift, and position of the remainder: rows value, and derivatives by θ, r, z.
    drift, rho = np.zeros((3, 3)), np.zeros((4, 3))
    for i in range(_CLIPS):
        for k in range(3):
            xi = params[_DRIFT + 3 * i + k]
            drift[0, k] += weights[i] * xi
            drift[1, k] += changes[0, i] * xi
            drift[2, k] += changes[1, i] * xi
            rho[0, k] += weights[i] * value[i, k]
            rho[1, k] += weights[i] * slope[i, k]
            rho[2, k] += changes[0, i] * value[i, k]
            rho[3, k] += changes[1, i] * value[i, k]
    update_lap(memory, angle, drift[0])
    if params[_GROUND] > 0.0:
        lift, by_angle, by_a, by_b = ground_correction(params, int(params[_GROUND]), angle, a, b)
        rho[0, 2] += lift
        rho[1, 2] += by_angle
        rho[2, 2] += by_a * a_slope
        rho[3, 2] += by_b * b_slope

    # Root: A · exp(s ξ) · ρ, with s = θ/2π and the heading α = s ω + A's.
    s = angle / (2.0 * np.pi)
    local, turn_rate = np.empty((3, 3)), np.empty(3)
    ahead, left = drift_motion(drift, s, local, turn_rate)
    heading = memory[LAP_HEADING] + s * drift[0, 2]
    lap_c, lap_s = np.cos(memory[LAP_HEADING]), np.sin(memory[LAP_HEADING])
    cosine, sine = np.cos(heading), np.sin(heading)
    pose[0] = memory[LAP_X] + lap_c * ahead - lap_s * left + cosine * rho[0, 0] - sine * rho[0, 1]
    pose[1] = memory[LAP_Y] + lap_s * ahead + lap_c * left + sine * rho[0, 0] + cosine * rho[0, 1]
    pose[2] = rho[0, 2]
    tangents = jacobian.shape[0] > 0
    # Columns: derivatives by θ, r, z; then the chain rule to the stylus.
    chain = np.zeros((3, 3))
    if tangents:
        inside = max(radius, _AXIS)
        chain[0, 0], chain[0, 1] = -x[1] / (inside * inside), x[0] / (inside * inside)
        chain[1, 0], chain[1, 1] = x[0] / inside, x[1] / inside
        chain[2, 2] = 1.0
        jacobian[:] = 0.0
        for k in range(3):
            rho_x, rho_y = rho[1 + k, 0] - turn_rate[k] * rho[0, 1], rho[1 + k, 1] + turn_rate[k] * rho[0, 0]
            v_x = lap_c * local[0, k] - lap_s * local[1, k] + cosine * rho_x - sine * rho_y
            v_y = lap_s * local[0, k] + lap_c * local[1, k] + sine * rho_x + cosine * rho_y
            for j in range(3):
                jacobian[0, j] += v_x * chain[k, j]
                jacobian[1, j] += v_y * chain[k, j]
                jacobian[2, j] += rho[1 + k, 2] * chain[k, j]

    unit, spin, q = np.empty((_CLIPS, 4)), np.empty((_CLIPS, 3)), np.empty(4)
    half_c, half_s = np.cos(0.5 * heading), np.sin(0.5 * heading)
    for joint in range((channels - 3) // 4):
        column = 3 + 4 * joint
        _unit_rotations(value, slope, column, unit, spin)
        mean_rotation(unit, weights, q)
        if tangents:
            mean_derivative(unit, spin, weights, changes, q, local)
            if joint == 0:
                # The vertical as the root sees it: the heading turns about it.
                up_x, up_y = 2.0 * (q[1] * q[3] - q[0] * q[2]), 2.0 * (q[2] * q[3] + q[0] * q[1])
                up_z = 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])
                for k in range(3):
                    local[0, k] += turn_rate[k] * up_x
                    local[1, k] += turn_rate[k] * up_y
                    local[2, k] += turn_rate[k] * up_z
            for i in range(3):
                for j in range(3):
                    total = local[i, 0] * chain[0, j] + local[i, 1] * chain[1, j] + local[i, 2] * chain[2, j]
                    jacobian[3 + 3 * joint + i, j] = total
        if joint == 0:
            q[0], q[1], q[2], q[3] = multiply(half_c, 0.0, 0.0, half_s, q[0], q[1], q[2], q[3])
        for j in range(4):
            pose[column + j] = q[j]


def _closing_signs(channels: Array) -> Array:
    """Signs (m, nq) with which remainders (N, m, nq) close: −1 for a quaternion that comes back as −q."""
    signs = np.ones(channels.shape[1:])
    for first in range(3, channels.shape[2], 4):
        dots = (channels[-1, :, first : first + 4] * channels[0, :, first : first + 4]).sum(axis=1)
        signs[:, first : first + 4] = np.where(dots < 0.0, -1.0, 1.0)[:, None]
    return signs


class Cylindrical(HapticMap):
    r"""Four clips round a cylinder about the z axis of H.

    .. math:: h = A \cdot \exp\bigl(\tfrac{\theta}{2\pi} \textstyle\sum_i w_i \xi_i\bigr) \cdot \bar{\rho}_w(\theta)

    θ = atan2(y, x) is the phase: one lap of the hand is one lap of every clip. The weights w_i(r, z) blend the four
    clips bilinearly and ease in at the edges (C²); beyond them they stay, so no limb is ever extrapolated.
    Positions are blended linearly, rotations by their chordal mean (`mean`), the drift over the ground by its twist
    ξ (`loops`).

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
    heights : Heights, optional
        Heights of the points of a pose that may touch the ground, so that blends do not sink into it (see `ground`).

    Raises
    ------
    ParameterError
        If there are not four clips of the same kind of pose, or an interval is empty.
    """

    def __init__(
        self,
        clips: Sequence[tuple[Array, float]],
        r_range: tuple[float, float],
        z_range: tuple[float, float],
        heights: Heights | None = None,
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
        channels = aligned_channels(self.loops, samples)
        drifts = np.concatenate([loop.drift for loop in self.loops])
        rows = control_points(channels, _closing_signs(channels)).ravel()
        table = np.zeros(0) if heights is None else ground_table(channels, heights)
        header = [samples, channels.shape[2], *r_range, *z_range, 0.0 if heights is None else _ROWS + len(rows)]
        self._params = np.concatenate([header, drifts, rows, table])
        self._nq = channels.shape[2]

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
        memory = np.zeros(MEMORY)
        memory[LAST_ANGLE] = np.nan
        return CompiledMap(CYLINDRICAL, self._params, memory)

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
