r"""Clips as closed loops: each is split into a steady drift over the ground and a periodic remainder.

.. math:: X_{root}(s) = \exp(s\,\xi)\,\rho(s), \qquad s \in [0, 1],\; \rho(1) = \rho(0)

ξ = (v, ω) is the planar twist whose exponential is the displacement of one lap: a walk continues from where the lap
ended, a spin returns to its start after a turn of ω = 2π. Everything else (ρ and the joints) is a periodic C² spline,
in R³ for the root's position and in R⁴, normalised, for each rotation.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from controllers.errors import ParameterError
from controllers.motion.channels import normalise
from geometry.arrays import Array
from geometry.quaternions import about_axis, product, with_continuous_signs

# [m], [rad] a lap that ends nearer to its start has no drift, unless its ends differ by that alone: a closed lap
_MAX_STILL_LENGTH, _MAX_STILL_ANGLE = 0.02, np.deg2rad(2.0)
MAX_CLOSURE_GAP = 1e-6  # [m], or components of quaternions (half of the angle in rad): largest gap of a closed clip
# least vertical component of the pelvis axis at which turns about the vertical are counted
_MIN_UPRIGHT_COMPONENT = 0.3
_SEAM_FRACTION = 0.2  # fraction of the lap at each end that may change when an open clip is closed
_CLOSING_TOLERANCE = 0.01  # [m], or components of quaternions: largest difference between the ends of a closed clip
# [rad/s] RMS of the joints, [m/s] of the root: largest speeds at rest
_MAX_REST_JOINT_SPEED, _MAX_REST_ROOT_SPEED = 1.5, 0.6
_BRAKING_TIME = 0.15  # [s] at each end of an open clip in which it is brought to rest, which takes twice this time


def plane_exponential(twist: Array) -> tuple[Array, Array]:
    """Displacements exp(ξ) in the plane: translations (..., 2) and angles (...), of twists (v, ω), shape (..., 3)."""
    angle = twist[..., 2]
    half = 0.5 * angle
    # sin α/α and (1 − cos α)/α by sinc: exact at α = 0.
    s, c = np.sinc(angle / np.pi), np.sin(half) * np.sinc(half / np.pi)
    x, y = twist[..., 0], twist[..., 1]
    return np.stack([s * x - c * y, c * x + s * y], axis=-1), angle


def rotate_in_plane(angle: Array, xy: Array) -> Array:
    """Vectors of the plane (..., 2) turned by angles (...)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)


def _periodic_spline(s: Array, values: Array, sign: float) -> CubicSpline:
    """C² spline through values whose last row is `sign` times the first; of period 2 if the sign is −1."""
    if sign > 0.0:
        return CubicSpline(s, np.vstack([values[:-1], values[:1]]), bc_type="periodic")
    twice = np.vstack([values[:-1], -values[:-1], values[:1]])
    return CubicSpline(np.concatenate([s[:-1], s + 1.0]), twice, bc_type="periodic")


def _hermite(x: Array) -> Array:
    """Quintic Hermite polynomials on [0, 1], shape (3, n): value, slope or second derivative 1 at 0, all others 0."""
    x = np.minimum(x, 1.0)
    rest = (1.0 - x) ** 3
    return np.stack([rest * (1.0 + 3.0 * x + 6.0 * x**2), rest * (x + 3.0 * x**2), rest * 0.5 * x**2])


def _end_derivatives(s: Array, values: Array) -> Array:
    """Value, slope and second derivative at s = 0, shape (3, c); the latter two by a cubic fit, against noise."""
    n = min(len(s), max(6, len(s) // 12))
    fit = np.polynomial.polynomial.polyfit(s[:n], values[:n], min(3, n - 1))
    return np.stack([values[0], fit[1], 2.0 * fit[2] if len(fit) > 2 else np.zeros_like(fit[0])])


def _close(s: Array, values: Array, sign: float) -> Array:
    """Close an open motion: move each end half way to the other, so that value, slope and second derivative meet."""
    start, end = _end_derivatives(s, values), _end_derivatives(1.0 - s[::-1], values[::-1])
    gaps = sign * end * [[1.0], [-1.0], [1.0]] - start
    reach = _SEAM_FRACTION ** np.arange(3)[:, None]
    first = np.einsum("kn,kc->nc", _hermite(s / _SEAM_FRACTION) * reach, 0.5 * gaps)
    # Seen from the end the parameter runs backwards, which changes the sign of the slope's part.
    last = np.einsum(
        "kn,kc->nc", _hermite((1.0 - s) / _SEAM_FRACTION) * reach * [[1.0], [-1.0], [1.0]], 0.5 * sign * gaps
    )
    return values + first - last


def _count_full_turns(quaternions: Array, net: float) -> int:
    """Whole turns about the vertical beyond the net turn, counted while the pelvis is upright: no somersaults."""
    upright = 1.0 - 2.0 * (quaternions[:, 1] ** 2 + quaternions[:, 2] ** 2)
    change = quaternions[1:] - quaternions[:-1]
    middle = 0.5 * (quaternions[1:] + quaternions[:-1])
    # Vertical component of the world's angular velocity: twice the k part of dq ⊗ q⁻¹.
    vertical = 2.0 * (
        change[:, 3] * middle[:, 0]
        - change[:, 0] * middle[:, 3]
        + change[:, 2] * middle[:, 1]
        - change[:, 1] * middle[:, 2]
    )
    counted = vertical[(upright[1:] > _MIN_UPRIGHT_COMPONENT) & (upright[:-1] > _MIN_UPRIGHT_COMPONENT)].sum()
    return round(float(counted - net) / (2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class Loop:
    """One clip as a closed loop over the phase s in [0, 1].

    Attributes
    ----------
    drift : Array, shape (3,)
        ξ = (v_x, v_y [m], ω [rad]) per lap.
    duration : float
        Duration of a lap [s].
    splines : list of CubicSpline
        ρ's position, then root and joint rotations in R⁴, each of period 1, or 2 if q returns as −q.
    share : float
        Number of repeats of the clip (period 1 of the splines) in a lap (see `strides`).
    """

    drift: Array
    duration: float
    splines: list[CubicSpline]
    share: float = 1.0

    def channels(self, s: Array, lead: Array) -> Array:
        """Remainder at phases s (n,), with unit quaternions, shape (n, nq); the root is moved by exp(lead ξ)."""
        parts = [spline(np.mod(self.share * s, float(spline.x[-1]))) for spline in self.splines]
        rotations = [part / np.linalg.norm(part, axis=1, keepdims=True) for part in parts[1:]]
        shift, angle = plane_exponential(lead[:, None] * self.drift)
        parts[0][:, :2] = rotate_in_plane(angle, parts[0][:, :2]) + shift
        rotations[0] = product(about_axis(2, angle), rotations[0])
        return np.concatenate([parts[0], *rotations], axis=1)


def checked_clip(poses: Array, fps: float, name: str) -> Array:
    """Validated poses of a clip, with unit quaternions of continuous sign; raises `ParameterError`."""
    array = np.array(poses, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] < 7 or (array.shape[1] - 7) % 4 != 0:
        raise ParameterError(f"{name}: poses must have shape (n, 7 + 4 joints), got {array.shape}")
    if len(array) < 2:
        raise ParameterError(f"{name}: a clip needs at least 2 frames, got {len(array)}")
    if not (np.isfinite(fps) and fps > 0.0):
        raise ParameterError(f"{name}: fps must be positive and finite, got {fps}")
    if not np.isfinite(array).all():
        raise ParameterError(f"{name}: frame {int(np.argwhere(~np.isfinite(array))[0][0])} is not finite")
    for first in range(3, array.shape[1], 4):
        quaternions = array[:, first : first + 4]
        norms = np.linalg.norm(quaternions, axis=1, keepdims=True)
        if np.abs(norms - 1.0).max() > 1e-3:
            raise ParameterError(
                f"{name}: quaternion at number {first} of frame {int(np.abs(norms - 1).argmax())} is not unit"
            )
        array[:, first : first + 4] = with_continuous_signs(quaternions / norms)
    return array


def turn_of(poses: Array) -> tuple[float, int]:
    """Change of heading of a clip over its length [rad], up to half a turn, and the whole turns beyond it."""
    first, last = poses[0], poses[-1]
    w = float(last[3:7] @ first[3:7])
    # k part of q_last ⊗ q_first⁻¹: the change of heading is the twist of that rotation about the vertical.
    k = float(last[6] * first[3] - last[3] * first[6] + last[5] * first[4] - last[4] * first[5])
    net = float(2.0 * np.arctan2(k * np.sign(w or 1.0), abs(w)))
    return net, _count_full_turns(poses[:, 3:7], net)


def drift_of(poses: Array) -> Array:
    """ξ of a clip from its first and last frame and the turns between."""
    first, last = poses[0], poses[-1]
    net, turns = turn_of(poses)
    step = last[:2] - rotate_in_plane(np.array(net), first[:2])
    near = abs(net) < _MAX_STILL_ANGLE and float(np.hypot(*(last[:2] - first[:2]))) < _MAX_STILL_LENGTH
    if near and (turns or not _differs_over_the_floor_alone(first, last, net)):
        return np.array([0.0, 0.0, 2.0 * np.pi * turns])
    if abs(net) < 1.0:
        turns = 0  # the exponential of a twist of whole turns has no translation, so these stay in the remainder
    angle = net + 2.0 * np.pi * turns
    columns, _ = plane_exponential(np.array([[1.0, 0.0, angle], [0.0, 1.0, angle]]))
    return np.append(np.linalg.solve(columns.T, step), angle)


def _differs_over_the_floor_alone(first: Array, last: Array, turn: float) -> bool:
    """Whether a pose (nq,) is another one, moved over the floor and turned by an angle [rad]."""
    before, after = first[3:].reshape(-1, 4).copy(), last[3:].reshape(-1, 4)
    before[0] = product(about_axis(2, np.array(turn)), before[0])
    gaps = np.minimum(np.abs(after - before).max(axis=1), np.abs(after + before).max(axis=1))
    moved = max(abs(turn), float(np.hypot(*(last[:2] - first[:2]))))
    return moved > MAX_CLOSURE_GAP and bool(max(abs(last[2] - first[2]), gaps.max()) < MAX_CLOSURE_GAP)


def periodic_remainder(poses: Array, s: Array, drift: Array) -> Array:
    """ρ and the joints: the poses with the root moved by exp(−s ξ)."""
    rest = poses.copy()
    shift, angle = plane_exponential(s[:, None] * drift)
    rest[:, :2] = rotate_in_plane(-angle, poses[:, :2] - shift)
    rest[:, 3:7] = product(about_axis(2, -angle), poses[:, 3:7])
    return rest


def placed_at_origin(poses: Array, s: Array) -> tuple[Array, Array]:
    r"""Poses moved over the ground such that the remainder at phases s is at the origin, facing +x, and their drift.

    Moved by G ∈ SE(2), the remainder becomes G ρ, and the drift

    .. math:: \mathrm{Ad}_G\,\xi = (R\,v + \omega\,(p_y, -p_x),\; \omega), \qquad G = (p, R) .

    Whole turns are about the middle of the clip; on the spot, it stays there.

    Parameters
    ----------
    poses : Array, shape (n, nq)
    s : Array, shape (n,)

    Returns
    -------
    placed : Array, shape (n, nq)
    drift : Array, shape (3,)
        ξ of the placed clip.
    """
    placed = poses.copy()
    placed[:, :2] -= (poses[:, :2] - s[:, None] * (poses[-1, :2] - poses[0, :2])).mean(axis=0)
    drift = drift_of(placed)
    rest = periodic_remainder(placed, s, drift)
    whole_turns = not drift[:2].any()
    middle = rest[:, :2].mean(axis=0) * (drift[2] != 0.0)
    if whole_turns and np.hypot(*middle) < _MAX_STILL_LENGTH:
        middle = np.zeros(2)
    placed[:, :2] -= middle
    w, _, _, z = rest[:, 3:7].T
    # Mean heading by the doubled half angle, which is independent of the sign of a quaternion.
    heading = np.arctan2(2.0 * (w * z).sum(), (w * w - z * z).sum())
    placed[:, :2] = rotate_in_plane(np.array(-heading), placed[:, :2])
    placed[:, 3:7] = product(about_axis(2, np.full(len(s), -heading)), placed[:, 3:7])
    if not whole_turns:
        return placed, drift_of(placed)
    x, y = rotate_in_plane(np.array(-heading), -middle)
    return placed, drift[2] * np.array([y, -x, 1.0])


def append_reversal(poses: Array, fps: float) -> Array:
    r"""Append its time reversal to an open clip that (nearly) rests at both ends; return any other clip unchanged.

    q(2T − t) has the accelerations of q(t), and velocities enter M q̈ + c(q, q̇) = τ + Jᵀ f by their squares: with
    the same torques and contact forces it is equally feasible, its flights are ballistic, and its feet stand in the
    same places. Remaining motion is brought to rest: the 0.15 s at each end are played at a pace that falls to 0.
    """
    first, last = poses[0], poses[-1]
    signs = np.sign(np.einsum("jx,jx->j", first[3:].reshape(-1, 4), last[3:].reshape(-1, 4)))
    mismatch = np.abs(last[7:].reshape(-1, 4) - signs[1:, None] * first[7:].reshape(-1, 4)).max(initial=0.0)
    if mismatch < _CLOSING_TOLERANCE and abs(last[2] - first[2]) < _CLOSING_TOLERANCE:
        return poses
    for step in (poses[1] - first, last - poses[-2]):
        joints = 2.0 * fps * np.linalg.norm(step[3:].reshape(-1, 4), axis=1)
        if np.sqrt(np.mean(joints**2)) > _MAX_REST_JOINT_SPEED or fps * np.linalg.norm(step[:3]) > _MAX_REST_ROOT_SPEED:
            return poses
    seconds = (len(poses) - 1) / fps
    braking = min(_BRAKING_TIME, 0.25 * seconds)
    # Clip time u: u = t²/(4 b) while the pace rises, for 2 b (b: `braking`); then pace 1; then the same in reverse.
    times = np.linspace(0.0, seconds + 2.0 * braking, int(np.ceil((seconds + 2.0 * braking) * fps)) + 1)
    rest = times[-1] - times
    clip_times = np.where(times < 2.0 * braking, times**2 / (4.0 * braking), times - braking)
    clip_times = np.where(rest < 2.0 * braking, seconds - rest**2 / (4.0 * braking), clip_times)
    slow = CubicSpline(np.arange(len(poses)) / fps, poses)(np.clip(clip_times, 0.0, seconds))
    normalise(slow, (slow.shape[1] - 3) // 4)
    return np.concatenate([slow, slow[-2::-1]])


def closed_loop(poses: Array, fps: float) -> Loop:
    """Loop of a clip; an open clip that nearly rests at both ends is played there and back (`append_reversal`)."""
    return forward_loop(append_reversal(np.asarray(poses, dtype=np.float64), fps), fps)


def forward_loop(poses: Array, fps: float) -> Loop:
    """Loop of a clip of poses (n, nq) that passed `checked_clip`, moved to the origin and facing +x on average.

    A clip that does not close is closed: over the first and last fifth of the lap its ends are moved half way to each
    other by quintics, so that value, slope and second derivative meet.
    """
    s = np.linspace(0.0, 1.0, len(poses))
    placed, drift = placed_at_origin(poses, s)
    rest = periodic_remainder(placed, s, drift)
    splines: list[CubicSpline] = []
    for first, stop in [(0, 3), *((k, k + 4) for k in range(3, poses.shape[1], 4))]:
        values = rest[:, first:stop]
        sign = -1.0 if first and values[-1] @ values[0] < 0.0 else 1.0
        if np.abs(values[-1] - sign * values[0]).max() > 1e-6:
            values = _close(s, values, sign)
        splines.append(_periodic_spline(s, values, sign))
    return Loop(drift, (len(poses) - 1) / fps, splines)
