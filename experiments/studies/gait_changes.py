"""Experiment that could refute changes between gaits on a lifted map: hands go from one curve to another at any angle.

``python -m experiments.studies.gait_changes MAP.npz FIRST SECOND`` moves a hand from curve to curve of a map that
`hvf lift` wrote, as fast as rivers do, begun at six angles, and holds it at shares of the way between them. The
physical figure follows each animation, and a table shows its residual, or when it falls.

A river that takes a hand sets the pace of its own clip at once, or gradually
(`controllers.fields.higher_order.HigherOrder.ease`), and the figure goes from clip to clip with the hand, or gradually
(`sim.reference.cross_track`).
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.signal import lsim

from controllers.haptic_map.lifted import Lifted
from controllers.state import stylus_path
from experiments.files.map_files import load_figure_map
from experiments.fitting.animation_trial import FPS
from experiments.preparation.followed import Followed
from experiments.preparation.tracking_trial import followed
from experiments.setups.modes.lifted_runs import CROSS_RATE, EASE_TIME, curve_number
from geometry.arrays import Array
from geometry.easing import smooth_steps
from models.mocap.motion.clip import Clip
from sim.compilation.unit_workers import compile_units
from sim.errors import SimError
from sim.reference.reference import map_poses

CROSSING_TIME = 0.35
"""Duration of a hand's change of place [s]."""
MANNERS = ((math.inf, 0.35), (math.inf, EASE_TIME), (CROSS_RATE, EASE_TIME))
"""Rates ω with which the figure follows across [1/s], and durations of the change of pace [s]."""
ANGLES = tuple(np.arange(0.0, 2.0 * np.pi, np.pi / 3.0))
"""Angles of the lap at which changes begin [rad]."""
SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Shares of the way from curve to curve at which a hand is held."""
_BEFORE, _AFTER = 2.5, 4.0  # [s] on the first curve at least, and from the change's beginning to the end


def _paces(haptic_map: Lifted, curve: int) -> Callable[[float], float]:
    """θ̇ of a clip at its own pace [rad/s], as a function of θ."""
    angles = haptic_map.angles[curve]
    rates = np.gradient(angles, 1.0 / haptic_map.clips[curve][1])
    return lambda angle: float(np.interp(angle, angles, rates, period=2.0 * np.pi))


def _animation(haptic_map: Lifted, angles: Array, shares: Array, curves: tuple[int, int]) -> Clip:
    """Animation of a hand at angles (n,) of the lap and shares (n,) of the way from one curve to another."""
    first, second = (haptic_map.site(i, angles) for i in curves)
    r, z = (first + shares[:, None] * (second - first)).T
    points = np.column_stack([r * np.cos(angles), r * np.sin(angles), z])
    return Clip(map_poses(haptic_map, stylus_path(points)), FPS, "change")


def _followed(clip: Clip) -> Followed:
    return followed(clip, clip.duration - 1.0, compile_units)


def _followed_share(shares: Array, rate: float) -> Array:
    """The shares of the way (n,) at which the figure is, of a hand at shares (n,), in steps of 1/`FPS`."""
    if math.isinf(rate):
        return shares
    low_pass = ([rate**2], [1.0, 2.0 * rate, rate**2])
    return np.asarray(lsim(low_pass, shares, np.arange(len(shares)) / FPS)[1])


def changed(haptic_map: Lifted, curves: tuple[int, int], begin: float, manner: tuple[float, float]) -> Followed:
    """How the figure follows a hand that goes from one closed curve to another, begun at an angle [rad].

    The hand's place changes along a smooth step of `CROSSING_TIME`, its pace along one of the second number of `manner`
    [s], whose first is ω [1/s]; needs compiled code.
    """
    first, second = (_paces(haptic_map, i) for i in curves)
    angles = [0.0]
    while len(angles) < _BEFORE * FPS:
        angles.append(angles[-1] + first(angles[-1]) / FPS)
    begin = angles[-1] + (begin - angles[-1]) % (2.0 * np.pi)
    while angles[-1] < begin:
        angles.append(angles[-1] + first(angles[-1]) / FPS)
    shares = [0.0] * len(angles)
    for since in np.arange(1, round(_AFTER * FPS) + 1) / FPS:
        share, pace = smooth_steps(since / np.array([CROSSING_TIME, manner[1]]))
        angles.append(angles[-1] + ((1.0 - pace) * first(angles[-1]) + pace * second(angles[-1])) / FPS)
        shares.append(float(share))
    return _followed(_animation(haptic_map, np.array(angles), _followed_share(np.array(shares), manner[0]), curves))


def held(haptic_map: Lifted, curves: tuple[int, int], share: float, seconds: float = 9.0) -> Followed:
    """How the figure follows a hand that is held at a share of the way from one closed curve to another."""
    first, second = (_paces(haptic_map, i) for i in curves)
    angles = [0.0]
    for _ in range(round(seconds * FPS)):
        angles.append(angles[-1] + ((1.0 - share) * first(angles[-1]) + share * second(angles[-1])) / FPS)
    return _followed(_animation(haptic_map, np.array(angles), np.full(len(angles), share), curves))


def _cell(result: Followed) -> str:
    return f"{100 * result.residual:.1f}" if result.fell is None else f"falls {result.fell:.1f}"


def main(file: str, first: str, second: str) -> None:
    """Print the tables of changes in both directions, and of hands held between."""
    haptic_map, _ = load_figure_map(Path(file))
    one, other = curve_number(haptic_map, first), curve_number(haptic_map, second)
    if not (haptic_map.closed[one] and haptic_map.closed[other]):
        raise SimError(f"{first} and {second}: one of them is open; expected two curves that close, as gaits have")
    print("Residual [% of weight] or time of the fall [s], by the angle at which the change begins.\n")
    print("| change | ω [1/s], pace [s] |", " | ".join(f"{np.degrees(angle):.0f}°" for angle in ANGLES), "|")
    print("|---" * (2 + len(ANGLES)) + "|")
    for curves in ((one, other), (other, one)):
        name = " → ".join(haptic_map.names[i] for i in curves)
        for manner in MANNERS:
            cells = [_cell(changed(haptic_map, curves, angle, manner)) for angle in ANGLES]
            print(f"| {name} | {manner[0]:g}, {manner[1]:g} |", " | ".join(cells), "|", flush=True)
    cells = [f"{share:g}: {_cell(held(haptic_map, (one, other), share))}" for share in SHARES]
    print("\nHeld at shares of the way:", ", ".join(cells))


if __name__ == "__main__":
    main(*sys.argv[1:])
