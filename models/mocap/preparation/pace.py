r"""Correction of a capture's frame rate, so that its flights are ballistic under gravity.

In flight the centre of mass moves on a parabola with acceleration −g. Playing a clip σ times as fast scales its
accelerations by σ², so a clip whose flights fall with acceleration a is right at

.. math:: \sigma = \sqrt{g / a} .

Files may have a wrong frame rate, and performers of another size have another time scale. A motion keeps its character
at another pace, but not if its flights are adapted to gravity one by one. Only clips that fall too fast are slowed:
nothing can pull a body down, but one that falls too slowly may be supported by a foot that was captured too high. Over
several flights of durations T the acceleration is averaged with weights T⁴, since the error of a parabola's
acceleration goes with T⁻².
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, rms
from geometry.physics import GRAVITY
from geometry.spans import spans
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import contact_points
from models.mocap.preparation.bounds import MAX_FLIGHT_ACCELERATION_ERROR

# Least height of feet and hands in flight [m]: captured feet hover by 1 to 2 cm while they stand. Half the value slows
# SNU's run to 0.85 of its pace; twice changes no pace of 17 captures by more than 0.03.
_MIN_FLIGHT_HEIGHT = 0.03
# Height that all of them exceed at some time in a flight [m]: dancers' feet hover higher than walkers'. Half the value
# changes the pace of none of 19 captures, twice finds no flight in DeepMimic's run.
_MIN_PEAK_HEIGHT = 0.08
# Least duration of a flight from which the acceleration is estimated [s]. Half the value slows SNU's run to 0.80 of its
# pace, and twice finds no flight in DeepMimic's run; the other 17 of 19 captures keep their pace.
_MIN_FLIGHT_DURATION = 0.09
_MIN_PACE = 0.35  # least pace; a slower one would be due to another fault: SNU's backflip needs 0.40, all others more


class Paced(NamedTuple):
    """A clip with a corrected frame rate.

    Attributes
    ----------
    clip : Clip
        The same frames at another rate.
    pace : float
        Corrected rate over the file's.
    falls : float or None
        Downward acceleration in the file's flights [m/s²], if it has any.
    departure : float
        RMS distance of the heights in these flights from parabolas, relative to how far the parabolas bend, whatever
        the frame rate.
    """

    clip: Clip
    pace: float
    falls: float | None
    departure: float = 0.0


class FlightFall(NamedTuple):
    """Downward acceleration in the flights of a clip [m/s²], and their `Paced.departure`."""

    acceleration: float
    departure: float


def correct_pace(clip: Clip) -> Paced:
    """The clip at the pace that makes its flights ballistic; unchanged within `MAX_FLIGHT_ACCELERATION_ERROR`."""
    fall = flight_fall(clip)
    if fall is None:
        return Paced(clip, 1.0, None)
    falls, departure = fall
    if falls < GRAVITY + MAX_FLIGHT_ACCELERATION_ERROR or falls > GRAVITY / _MIN_PACE**2:
        return Paced(clip, 1.0, falls, departure)
    pace = float(np.sqrt(GRAVITY / falls))
    return Paced(Clip(clip.poses, clip.fps * pace, clip.name), pace, falls, departure)


def flight_fall(clip: Clip) -> FlightFall | None:
    """How the centre of mass falls while neither feet nor hands are near the floor; None if there is no such flight.

    Flights are found by heights alone, unlike in `contacts`, since all speeds depend on the rate in doubt. A body that
    is accelerated upwards in one stands on something, at whatever rate: on feet that hover, for example.
    """
    heights = contact_points(clip.poses, FOOT_CONTACTS + HAND_CONTACTS)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    flights = [
        (a, b)
        for a, b in spans(heights > _MIN_FLIGHT_HEIGHT)
        if b - a >= max(4, _MIN_FLIGHT_DURATION * clip.fps) and heights[a:b].max() > _MIN_PEAK_HEIGHT
    ]
    if not flights:
        return None
    height = momentum(clip).com[:, 2]
    falls, departures = np.array([_parabola(height[a:b], clip.fps) for a, b in flights]).T
    weights = np.where(falls > 0.0, [float(b - a) ** 4 for a, b in flights], 0.0)
    if not weights.any():
        return None
    return FlightFall(float(np.average(falls, weights=weights)), float(np.average(departures, weights=weights)))


def _parabola(heights: Array, fps: float) -> tuple[float, float]:
    """Downward acceleration [m/s²] of the parabola nearest to heights (n,), and their `Paced.departure`."""
    time = np.arange(len(heights)) / fps
    parabola = np.polyfit(time, heights, 2)
    bend = abs(parabola[0]) * time[-1] ** 2 / 4.0  # at its middle, from its chord
    return -2.0 * parabola[0], rms(heights - np.polyval(parabola, time)) / max(bend, np.finfo(float).tiny)
