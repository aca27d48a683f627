"""Led figures that are captured, or too slow to fly, sway to stand on their feet (`experiments.setups.balance`)."""

import mujoco
import numpy as np

from controllers.haptic_map.led import Led
from controllers.walking.gait import Gait
from experiments.setups.balance import measured_laps, nearest_supported, sway_of
from sim.body.figure import FigureGains
from sim.reference.reference import poses_along

# A foot that bears what it is not held to turns about itself: the plan gives it load, and lifts it. So on a led figure,
# which may stop anywhere, a point bears nothing from half the height on at which it is let go.
_WALKING = FigureGains(reference_reach=0.006, stance_height=0.012, lift_time=0.005)
# A gait that flies changes feet within a hundredth of a second, and would then stand on none; one kept on the ground
# takes a little longer.
_FLYING, _STEPPING = _WALKING._replace(reference_reach=0.012), _WALKING._replace(reference_reach=0.01)

_ROWS = 192  # of a lap
_ROUNDS = 6
_PACE = 0.8  # of the gait's own
_SHARE = 0.6  # of the support, about its middle, in which the zero-moment point is asked to lie


def led_gains(led: Led) -> FigureGains:
    """Of the physical figure that is led with a clip."""
    return _FLYING if led.flies else _STEPPING if led.grounds else _WALKING


def balanced_on_ground(led: Led, gait: Gait, figure: mujoco.MjModel) -> Led:
    """The same map, whose form without flights sways such that the floor can bear it at the pace of going back."""
    if not led.sways:
        return led
    sway, result, seconds = np.zeros((_ROWS, 2)), led, gait.stride / (_PACE * gait.speed)
    walker = np.zeros((_ROWS + 2, 7))
    walker[:, 0] = led.stride * (np.arange(-1, _ROWS + 1) / _ROWS - led.phase)
    walker[:, 1] = walker[:, 3] = 1.0
    poses = np.empty((1, _ROWS + 2, led.nq))
    for _ in range(_ROUNDS):
        compiled = result.compiled()
        poses_along(compiled.kind, compiled.params, compiled.memory, walker, poses[0])
        laps = measured_laps(poses, seconds / _ROWS, figure)
        outside = laps.load[..., None] * (nearest_supported(laps.zmp, laps.contacts, _SHARE) - laps.zmp)
        # In flight the mean place of the root is the clip's own: a way back to it would throw the figure.
        mean = outside[0].mean(axis=0) if gait.flies else 0.0
        sway += sway_of(outside[0] - mean, laps.height, seconds)
        swaying = led.with_sway(sway)
        if not swaying.sways:
            # A sway that would take too low a root is not taken.
            break
        result = swaying
    return result
