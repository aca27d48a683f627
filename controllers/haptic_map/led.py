r"""The map of a led figure: a clip of straight walking is carried along a curved path without foot skate.

.. math:: X_{root}(s) = A(s)\,\rho(s/\ell), \qquad X_{foot}(s) = A(s + \ell\,\lambda(s/\ell))\,\rho_{foot}(s/\ell)

A(s) ∈ SE(2) is the frame of the figure's path at arc length s (`controllers.walking.walked_path`), ℓ the length of the
clip's lap, ρ the pose without its steady drift (`loops`). λ is such that s + ℓλ is constant while the foot is in stance
and advances while it swings (`limbs`): so a foot in stance keeps its place while path and pelvis turn above it. The
legs follow by inverse kinematics. In bends the figure leans to the inside like an inverted pendulum whose foot is on
the path: root and trunk turn about the path by φ(s), and the root is lowered by twice the height that this lifts the
outer hip.

A clip with flight phases has a second form without them (`grounded`), for paces too slow for flights of that length.
Channels are (1 − u) ρ + u ρ_grounded; u, the share of the grounded form, is the walker's second number.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.curves.splines import control_points, interpolate
from controllers.errors import ParameterError
from controllers.haptic_map.base import KernelMap
from controllers.legs.grounded import grounded, max_swing_speed_ratio, stepping
from controllers.legs.limb_ends import with_ends
from controllers.legs.limb_kinematics import solve_limb
from controllers.legs.limbs import LAST, LIMB_SIZE, N_END_CHANNELS, Limb
from controllers.motion.channels import closing_signs
from controllers.motion.loops import checked_clip, forward_loop, rotate_in_plane, turn_of
from controllers.walking.walked_path import (
    PATH_HEADING,
    PATH_LEAN,
    PATH_X,
    PATH_Y,
    ROWS,
    STEP,
    path_value,
    straight_path,
)
from controllers.work_array import work_array
from geometry.arrays import Array, Mask
from geometry.quaternions import about_axis, product
from geometry.rotations import multiply
from geometry.spans import cyclic_spans
from geometry.vectors import unit_rotation

_STRIDE, _PHASE, _SAMPLES, _ROTATIONS, _LIMBS, _FORMS, _WIDTH, _HEADER = range(8)

MIN_TRAVEL, MAX_TURN = 0.5, np.deg2rad(30.0)
"""Least length [m] and largest turn [rad] of a led clip's lap; `models.mocap.preparation.laps` cuts laps by them."""

_LEAN_ROUNDING = 0.015  # [rad] lean below which the root is hardly lowered: rounding of |φ| at zero
# lowering of the root over the rise of the outer hip; above 1, since in bends feet also swing outwards
_LOWERING_RATIO = 2.0


@njit
def _interpolate_channels(rows: Array, samples: int, lap: float, value: Array, slope: Array) -> None:
    """Channels at a phase of the lap, and their derivatives by it, from uniform cubic B-splines."""
    place = (lap - np.floor(lap)) * samples
    row = min(int(place), samples - 1)
    n = value.shape[0]
    interpolate(rows[row * n :], n, place - row, float(samples), value, slope)


@njit
def _mix_forms(rows: Array, samples: int, lap: float, share: float, value: Array, slope: Array, change: Array) -> None:
    """Channels of a clip's two forms, mixed by u = `share`; `change` is written: their derivatives by u."""
    n = value.shape[0]
    ground, ground_slope = work_array(n), work_array(n)
    _interpolate_channels(rows, samples, lap, value, slope)
    _interpolate_channels(rows[n * (samples + 3) :], samples, lap, ground, ground_slope)
    for k in range(n):
        change[k] = ground[k] - value[k]
        value[k] += share * change[k]
        slope[k] += share * (ground_slope[k] - slope[k])


@njit
def _carry_along(  # noqa: PLR0913 - derivatives by either number of the walker in one kernel
    path: Array, s: float, pace: float, rate: float, lean: float, leaning: float, value: Array,
    slope: Array, by: int, p: Array, q: Array, spin: Array,
) -> None:  # fmt: skip
    """Transform a position and orientation from the frame A(s), leaning to the left by φ about the path, to the floor.

    Derivatives are by one of the walker's two numbers x: the figure's arc length, or u.

    Parameters
    ----------
    path, s
        The packed path, and the arc length of the frame [m].
    pace, rate : float
        Derivatives by x of s, and of the parameter of `slope`: the phase of the lap, or u itself.
    lean, leaning : float
        φ [rad] and its derivative by x.
    value, slope : Array, shape (7,)
        Position and quaternion, and their derivatives by the phase of the lap, or by u.
    by : int
        Which of the two numbers x is, 0 or 1.
    p, q, spin : Array, shapes (3, 3), (4,), (3, 2)
        Written: position and its derivative by x, unit quaternion, local angular velocity by x.
    """
    (x, d_x), (y, d_y) = path_value(path, s, PATH_X), path_value(path, s, PATH_Y)
    heading, turn = path_value(path, s, PATH_HEADING)
    c, sine = np.cos(heading), np.sin(heading)
    upright, over = np.cos(lean), np.sin(lean)
    side, high = upright * value[1] + over * value[2], upright * value[2] - over * value[1]
    d_side = rate * (upright * slope[1] + over * slope[2]) + leaning * high
    p[0, 0], p[0, 1], p[0, 2] = c * value[0] - sine * side, sine * value[0] + c * side, high
    p[1 + by, 0] = pace * (d_x - turn * p[0, 1]) + rate * c * slope[0] - sine * d_side
    p[1 + by, 1] = pace * (d_y + turn * p[0, 0]) + rate * sine * slope[0] + c * d_side
    p[1 + by, 2] = rate * (upright * slope[2] - over * slope[1]) - leaning * side
    p[0, 0] += x
    p[0, 1] += y
    spin[0, by], spin[1, by], spin[2, by] = unit_rotation(value[3:], slope[3:], rate, q)
    q[0], q[1], q[2], q[3] = multiply(np.cos(0.5 * lean), -np.sin(0.5 * lean), 0.0, 0.0, q[0], q[1], q[2], q[3])
    spin[0, by] -= leaning * (1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))
    spin[1, by] -= leaning * 2.0 * (q[1] * q[2] - q[0] * q[3])
    spin[2, by] -= leaning * 2.0 * (q[1] * q[3] + q[0] * q[2])
    up_x, up_y = 2.0 * (q[1] * q[3] - q[0] * q[2]), 2.0 * (q[2] * q[3] + q[0] * q[1])
    spin[0, by] += pace * turn * up_x
    spin[1, by] += pace * turn * up_y
    spin[2, by] += pace * turn * (1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]))
    q[0], q[1], q[2], q[3] = multiply(np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading), q[0], q[1], q[2], q[3])


@njit
def _lowering(lean: float, leaning: float, width: float) -> tuple[float, float]:
    """Lowering of the root of a leaning figure [m], in proportion to the rise of its outer hip, and its derivative.

    Otherwise a leg that lands straight would be too short, and its knee would stop with a jerk.
    """
    size = np.sqrt(lean * lean + _LEAN_ROUNDING * _LEAN_ROUNDING)
    return width * (size - _LEAN_ROUNDING), width * leaning * lean / size


@njit
def led_map(params: Array, x: Array, path: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Led`: h(s, u) with (s, u) = x[:2], and h_* unless `jacobian` has no rows; the memory is the path."""
    stride = params[_STRIDE]
    samples, rotations, limbs = int(params[_SAMPLES]), int(params[_ROTATIONS]), int(params[_LIMBS])
    n, s, rate = 3 + 4 * rotations + N_END_CHANNELS * limbs, x[0], 1.0 / stride
    value, slope, change = work_array(n), work_array(n), work_array(n)
    change[:] = 0.0
    rows, lap = params[_HEADER + LIMB_SIZE * limbs :], s / stride + params[_PHASE]
    if params[_FORMS] > 1.0:
        _mix_forms(rows, samples, lap, x[1], value, slope, change)
    else:
        _interpolate_channels(rows, samples, lap, value, slope)
    q, spins = work_array((rotations, 4)), work_array((rotations, 3, 2))
    root, end = work_array((3, 3)), work_array((3, 3))
    tangents = 2 if jacobian.shape[0] > 0 else 0
    lean, leaning = path_value(path, s, PATH_LEAN)
    _carry_along(path, s, 0.0, 1.0, lean, 0.0, value, change, 1, root, q[0], spins[0])
    _carry_along(path, s, 1.0, rate, lean, leaning, value, slope, 0, root, q[0], spins[0])
    lower, lowering = _lowering(lean, leaning, params[_WIDTH])
    root[0, 2] -= lower
    root[1, 2] -= lowering
    for joint in range(1, rotations):
        at, spin = 3 + 4 * joint, spins[joint]
        for by, by_x, pace in ((1, change, 1.0), (0, slope, rate)):
            turn = unit_rotation(value[at : at + 4], by_x[at : at + 4], pace, q[joint])
            spin[0, by], spin[1, by], spin[2, by] = turn
    part, by_lap, by_form = work_array(7), work_array(7), work_array(7)
    for i in range(limbs):
        limb = params[_HEADER + LIMB_SIZE * i : _HEADER + LIMB_SIZE * (i + 1)]
        last, at = int(limb[LAST]), 3 + 4 * rotations + N_END_CHANNELS * i
        for numbers, channels in ((part, value), (by_lap, slope), (by_form, change)):
            numbers[:3], numbers[3:] = channels[at : at + 3], channels[3 + 4 * last : 7 + 4 * last]
        s_end, pace = s + stride * value[at + 3], 1.0 + slope[at + 3]
        _carry_along(path, s_end, stride * change[at + 3], 1.0, 0.0, 0.0, part, by_form, 1, end, q[last], spins[last])
        _carry_along(path, s_end, pace, rate, 0.0, 0.0, part, by_lap, 0, end, q[last], spins[last])
        solve_limb(limb, q, spins, root, end, tangents)
    pose[:3] = root[0]
    for joint in range(rotations):
        pose[3 + 4 * joint : 7 + 4 * joint] = q[joint]
    if tangents:
        jacobian[:] = 0.0
        for by in range(2):
            jacobian[:3, by] = root[1 + by]
            for joint in range(rotations):
                jacobian[3 + 3 * joint : 6 + 3 * joint, by] = spins[joint, :, by]


class Led(KernelMap):
    r"""A travelling clip on the path of a figure that is led (see `controllers.fields.leading`).

    The map's argument is not the stylus but the walker: ``[s, u, 0, 1, 0, 0, 0]``, with s the arc length [m] and u
    from 0, the clip, to 1, the clip without its flight phases. The memory is the walker's path
    (`controllers.walking.walker`); `compiled` gives a straight one through the origin.

    Parameters
    ----------
    clip : (Array, float)
        Poses (n, nq) and frames per second. A clip that does not close is closed (`forward_loop`).
    limbs : sequence of Limb
        Legs with feet that stand.
    phase : float
        Phase of the lap at s = 0, as a share of the lap.
    standing : array of bool, shape (m, limbs), optional
        Which limbs are in stance, at m equal steps of the lap; no limb is in flight phases. Without it u has no effect.
    longest_step : float, optional
        The clip steps instead of flying, whatever u is, by steps of this length at most [m], unless it hops on one
        foot. Without it, it flies at u = 0.
    sway : Array, shape (k, 2), optional
        Displacement over the floor of the root of the form without flights [m], at k equal steps of the lap.

    Attributes
    ----------
    flies, has_grounded_form : bool
        Whether it has flight phases at u = 0, and whether it has a form without the flight phases of its clip.
    stride, duration : float
        Length [m] and duration [s] of a lap; shorter than the clip's if its steps would be too long without flights.
    pace : float
        Largest pace, in multiples of the clip's own, at which no limb swings faster than in the clip.

    Raises
    ------
    ParameterError
        If the clip travels less than 0.5 m per lap, or turns by more than 30° per lap.
    """

    map_kernel = staticmethod(led_map)

    def __init__(
        self,
        clip: tuple[Array, float],
        limbs: Sequence[Limb],
        phase: float = 0.0,
        standing: Mask | None = None,
        longest_step: float | None = None,
        sway: Array | None = None,
    ) -> None:
        self._arguments = (clip, tuple(limbs), phase, standing, longest_step, sway)
        poses, fps = clip
        checked = checked_clip(poses, fps, "the clip that is led")
        loop, (net, turns) = forward_loop(checked, fps), turn_of(checked)
        turn = net + 2.0 * np.pi * turns
        self.phase = phase
        self.stride = float(np.hypot(loop.drift[0], loop.drift[1]))
        self.duration = loop.duration
        if self.stride < MIN_TRAVEL or abs(turn) > MAX_TURN:
            advice = "" if self.stride < MIN_TRAVEL else "; cut out a straight part, as by hvf prepare --loop START:END"
            raise ParameterError(
                f"a clip that is led must go somewhere: {MIN_TRAVEL} m or more a lap, turning by at most "
                f"{np.degrees(MAX_TURN):.0f}°; this one goes {self.stride:.2f} m and turns "
                f"{np.degrees(turn):.0f}°. Walk and run do{advice}"
            )
        samples = int(np.clip(len(poses) - 1, 64, 2048))
        channels = loop.channels(np.arange(samples) / samples, np.zeros(samples))
        # The path is along x, whichever way the figure faces while it walks.
        course = -np.arctan2(loop.drift[1], loop.drift[0])
        channels[:, :2] = rotate_in_plane(course, channels[:, :2])
        channels[:, 3:7] = product(about_axis(2, course), channels[:, 3:7])
        drift = np.array([[self.stride, 0.0, loop.drift[2]]])
        limbs = [limb.with_limits_for([channels]) for limb in limbs]
        rows = with_ends(channels[:, None], drift, limbs, np.ones(1))[:, 0]
        self._rotations = (channels.shape[1] - 3) // 4
        signs, forms = closing_signs(rows, self._rotations), [rows]
        self.flies, self.has_grounded_form, self.pace = False, False, 1.0
        if standing is not None:
            stance = standing[np.floor(np.arange(samples) * (len(standing) / samples)).astype(int)]
            sway = np.zeros((2, 2)) if sway is None else sway
            self.flies = bool(cyclic_spans(~np.any(stance, axis=1)))
            if longest_step is None or not self.flies:
                low = grounded(rows, signs, self.stride, limbs, stance, sway)
                forms = [rows] if low is None else [rows, low]
                self.has_grounded_form = low is not None
            elif (steps := stepping(rows, signs, self.stride, limbs, stance, sway, longest_step)) is not None:
                forms, self.stride = [steps[0]], steps[1]
                self.flies, self.has_grounded_form, self.pace = False, True, 1.0 / max_swing_speed_ratio(stance)
        lags = np.array([form[:, channels.shape[1] + 3 :: N_END_CHANNELS] for form in forms])
        self.reach = self.stride * float(np.abs(lags).max(initial=0.0))
        width = _LOWERING_RATIO * max((abs(float(limb.offsets[0, 1])) for limb in limbs), default=0.0)
        header = [self.stride, phase, samples, self._rotations, len(limbs), len(forms), width]
        packed = (control_points(form, signs).ravel() for form in forms)
        super().__init__(np.concatenate([header, *(limb.packed() for limb in limbs), *packed]))

    def with_sway(self, sway: Array) -> "Led":
        """The same map with another sway (k, 2) [m] of the forms without flight phases."""
        clip, limbs, phase, standing, longest_step, _ = self._arguments
        return Led(clip, limbs, phase, standing, longest_step, sway)

    def begun_at(self, phase: float) -> "Led":
        """The same map with another phase of the lap at s = 0."""
        clip, limbs, _, standing, longest_step, sway = self._arguments
        return Led(clip, limbs, phase, standing, longest_step, sway)

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return 3 + 4 * self._rotations

    def fresh_memory(self) -> Array:
        """The memory of a new run: a straight path along x, 30 m to both sides of the origin."""
        return straight_path(0.0, 0.0, 0.0, 0.5 * ROWS * STEP)
