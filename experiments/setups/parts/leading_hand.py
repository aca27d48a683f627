"""The default hand that leads: along an S at the gait's own pace, and straight back."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.leading import Leading
from geometry.arrays import Array
from geometry.easing import cubic_steps
from sim.users.hand.arm import Arm

HALF_TURN = 0.25 * np.pi  # each half of the S turns from −45° to 45° or back
PAUSE_TIME, RETURN_RATE = 0.8, 0.5  # [s] of each pause; pace of the way back over the clip's own
STIFFNESS = 150.0  # of the arm [N/m]: compliant enough to be guided
_PERIOD, _RAMP_TIME = 0.01, 0.8  # [s] between the points of the hand's path, and of a ramp up or down of its pace
_START_X, _END_X = -0.06, 0.08  # x of the ends of the S in H [m]


def s_curve() -> Trajectory:
    """The S along which the default hand leads, in the plane z = 0 of H: two arcs, parametrised by arc length [m]."""
    radius = (_END_X - _START_X) / (4.0 * np.sin(HALF_TURN))
    turn = np.linspace(-HALF_TURN, HALF_TURN, 65)
    headings = np.concatenate([turn, turn[-2::-1]])
    steps = radius * (turn[1] - turn[0])
    middle = 0.5 * (headings[1:] + headings[:-1])
    steps_taken = np.stack([np.cos(middle), np.sin(middle), np.zeros(len(middle))], axis=1) * steps
    points = np.array([_START_X, 0.0, 0.0]) + np.concatenate([np.zeros((1, 3)), np.cumsum(steps_taken, axis=0)])
    return Trajectory(steps * np.arange(len(points)), points)


def leading_hand(field: Leading) -> Arm:
    """The default hand: a pause, along the S at the gait's own pace, a pause, straight back more slowly."""
    curve = s_curve()
    seconds = field.walking.scale * curve.length / field.walking.gait.speed
    start, end = curve.point(curve.start), curve.point(curve.end)
    away = float(np.linalg.norm(end - start)) / curve.length
    forth, back = _eased_progress(seconds), _eased_progress(seconds * away / RETURN_RATE)
    path = np.concatenate([
        np.tile(start, (round(PAUSE_TIME / _PERIOD), 1)), curve.point(curve.start + curve.duration * forth),
        np.tile(end, (round(PAUSE_TIME / _PERIOD), 1)), end + back[:, None] * (start - end),
    ])  # fmt: skip
    return Arm(STIFFNESS, path=path, period=_PERIOD)


def _eased_progress(seconds: float) -> Array:
    """Progress from 0 to 1, sampled every `_PERIOD`, at a constant rate with ramps of `_RAMP_TIME` at both ends."""
    t = np.arange(_PERIOD, seconds + _RAMP_TIME, _PERIOD)
    total = np.cumsum(cubic_steps(np.minimum(t, seconds + _RAMP_TIME - t) / _RAMP_TIME))
    return total / total[-1]
