"""The runs from which the paper's figures are drawn, and access to their recordings."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from experiments.config.maps import Composite, RiverClips
from experiments.config.modes import Rivers, StretchThenFollow
from experiments.config.run_config import RunConfig, User
from experiments.runs.demo import demo_config
from geometry.arrays import Array
from sim.recording.recording import Recording

CYLINDER, COMPOSITE, STRETCH, RIVERS = "cylinder", "composite", "stretch", "rivers"
MILLIMETRES = 1e3  # in a metre


def configs() -> dict[str, RunConfig]:
    """Configurations of the runs by name of their folder; each can also be run by `hvf run`."""
    return {
        CYLINDER: demo_config(),
        COMPOSITE: RunConfig(map=Composite(), user=User(does="push"), seconds=9.0),
        STRETCH: RunConfig(mode=StretchThenFollow()),
        RIVERS: RunConfig(mode=Rivers(), map=RiverClips(), user=User(does="push"), seconds=8.0),
    }


def curve_of(recording: Recording) -> Trajectory:
    """The curve of a recording that leads the hand."""
    start, end = (float(time) for time in recording.arrays["curve_span"])
    points = recording.arrays["curve"]
    return Trajectory(
        np.linspace(start, end, len(points)), points, periodic=bool(recording.arrays["curve_closed"] > 0.5)
    )


def ticks(recording: Recording, start: float, end: float, *names: str) -> tuple[Array, ...]:
    """Channels of the ticks between two times [s], the times first."""
    t = recording.channel("ticks", "t")[:]
    rows = slice(int(np.searchsorted(t, start)), int(np.searchsorted(t, end)))
    return t[rows], *(recording.channel("ticks", name)[rows] for name in names)


def pushed_lap(recording: Recording) -> tuple[float, float]:
    """Start and end of the time in which the hand pushes, extended by a quarter of a second at each end [s]."""
    t, user = recording.channel("ticks", "t")[:], recording.channel("ticks", "user")[:]
    pushing = t[np.linalg.norm(user, axis=1) > 0.2]
    return max(0.0, float(pushing[0]) - 0.25), min(float(t[-1]), float(pushing[-1]) + 0.25)


def poses_at(recording: Recording, times: Array) -> Array:
    """The animation h(p) at times [s], shape (n, 75)."""
    t = recording.channel("frames", "t")[:]
    rows = np.clip(np.searchsorted(t, times), 0, len(t) - 1)
    channel = recording.channel("frames", "reference")
    return np.array([channel[int(row)] for row in rows])
