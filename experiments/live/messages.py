"""What the page asks of the engine's process, and what that tells it; what changes all the time is on boards."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.config.run_config import RunConfig

COURSE_POINTS = 241  # of the curve as it is bent
SLICE_SIDE = 9  # points of the field's slice along either side

SHOWN = {
    "t": 1, "cost": 2, "pace": 1, "fault": 1, "bends": 1, "performs": 1, "recording": 1, "curve": 1, "qpos": 256,
    "ghost": 75, "reference": 75, "p": 3, "v": 3, "force": 3, "user": 3, "target": 3, "switch": 1, "distance": 1,
    "phase": 1, "residual": 1, "course": 3 * COURSE_POINTS,
    "slice": 6 * SLICE_SIDE**2,
}  # fmt: skip
"""Board of the engine: what it shows, and how many numbers each is; ``curve`` counts changes of ``course``."""

HELD = {"grip": 1, "pressed": 1, "target": 3, "pace": 1, "paused": 1, "steps": 1, "slice": 1}
"""Board of the page: how it holds the stylus and the clock; ``steps`` counts steps that were asked for."""


@dataclass(frozen=True)
class Build:
    """Put another run together."""

    config: RunConfig


@dataclass(frozen=True)
class SetGains:
    """Take over the gains of a configuration."""

    config: RunConfig


@dataclass(frozen=True)
class Reset:
    """Go back to the beginning."""


@dataclass(frozen=True)
class GoBack:
    """Go back to the state that was kept before a time [s]."""

    t: float


@dataclass(frozen=True)
class Undo:
    """Take the last bend back."""


@dataclass(frozen=True)
class Redo:
    """Make a bend again."""


@dataclass(frozen=True)
class Perform:
    """Perform the bent curve, or bend it again."""

    now: bool


@dataclass(frozen=True)
class Rearm:
    """Forget a latched fault."""


@dataclass(frozen=True)
class Record:
    """Begin a take in a folder."""

    folder: Path


@dataclass(frozen=True)
class Stop:
    """End the take."""


@dataclass(frozen=True)
class Quit:
    """End the process."""


@dataclass(frozen=True)
class Built:
    """A run is there.

    Attributes
    ----------
    config : RunConfig
        With all that was left to defaults.
    drawn : dict
        What a recording keeps of curves and tubes (`Session.static`).
    bends : bool
        Whether its curve can be bent.
    remarks : tuple of str
        What is to be said.
    """

    config: RunConfig
    drawn: dict[str, Any]
    bends: bool
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Progress:
    """What goes on, and how far it is, from 0 to 1."""

    text: str
    share: float


@dataclass(frozen=True)
class Refused:
    """Something could not be done, and why."""

    text: str


@dataclass(frozen=True)
class Saved:
    """A take is in its folder; what happened in it, a sentence each."""

    folder: Path
    lines: tuple[str, ...]
