"""Balance of led figures: a sway for captured clips and for gaits too slow to fly (`experiments.fitting.balance`)."""

import mujoco
import numpy as np

from controllers.haptic_map.led import Led
from controllers.walking.gait import Gait
from experiments.fitting.balance import CUTOFF, measured_laps
from models.mocap.dynamics.zero_moment_point import sway_of
from sim.body.figure import FigureGains
from sim.reference.reference import map_poses

# A foot that is planned to bear load but is not held in place twists on the spot. A led figure may stop anywhere, so
# its contact points are unloaded at half the height (reference_reach) at which they are released (stance_height).
_WALKING = FigureGains(reference_reach=0.006, stance_height=0.012, lift_time=0.005, unload_time=0.005)
# A gait with flights changes feet within a hundredth of a second, and with the low reach would stand on neither foot; a
# gait kept on the ground takes a little longer.
_FLYING, _STEPPING = _WALKING._replace(reference_reach=0.012), _WALKING._replace(reference_reach=0.01)

_LAP_SAMPLES = 192  # samples of a lap
_ITERATIONS = 6  # each corrects the remaining error of the zero-moment point
_SWAY_PACE = 0.8  # pace at which the sway is computed, over the gait's own


def led_gains(led: Led) -> FigureGains:
    """Gains of a led physical figure, by whether its gait flies, is kept on the ground, or walks."""
    return _FLYING if led.flies else _STEPPING if led.has_grounded_form else _WALKING


def balanced_on_ground(led: Led, gait: Gait, figure: mujoco.MjModel) -> Led:
    """The same map with a sway of its flightless form that keeps the zero-moment point supported at 0.8 of its pace."""
    if not led.sways:
        return led
    sway, result, seconds = np.zeros((_LAP_SAMPLES, 2)), led, gait.stride / (_SWAY_PACE * gait.speed)
    walker_states = np.zeros((_LAP_SAMPLES + 2, 7))
    walker_states[:, 0] = led.stride * (np.arange(-1, _LAP_SAMPLES + 1) / _LAP_SAMPLES - led.phase)
    walker_states[:, 1] = walker_states[:, 3] = 1.0
    for _ in range(_ITERATIONS):
        laps = measured_laps(map_poses(result, walker_states)[None], seconds / _LAP_SAMPLES, figure)
        outside = laps.outside()
        # In flights the mean root position is the clip's own: a constant offset would have to be undone there, which
        # would throw the figure.
        mean = outside[0].mean(axis=0) if gait.flies else 0.0
        sway += sway_of(outside[0] - mean, laps.height, seconds, CUTOFF)
        swaying = led.with_sway(sway)
        if not swaying.sways:
            # This sway would need too low a root, so the previous one is kept.
            break
        result = swaying
    return result
