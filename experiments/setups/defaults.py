"""What the parts of a configuration leave to each other: gains by the kind of map.

Light to import, as what certificates are checked by is.
"""

from dataclasses import replace

from experiments.config.modes import Rivers, Stretch, StretchThenFollow
from experiments.config.run_config import RunConfig

RIVER_GAINS = {"default": (150.0, 16.0), "file": (50.0, 20.0)}
"""k_r [N/m] and b_d [N s/m] of the rivers about a circle, and of a map from a file."""
# Those of a map lie side by side: a hand that goes over from one to the other is drawn within τ = b_d/k_r, or the
# figure would have to be at the other clip's speed at once.
SEARCH = {"default": (150.0, 14.0), "file": (50.0, 20.0)}
"""k_f [N/m] and damping [N s/m] of stretchy tubes."""
# About a circle an edit that is undone takes the hand along in a tenth of a second, not in a fortieth. On a map from a
# file the search is as soft as rivers there are: what the hand does, the figure has to do, and curves that are near
# each other hold different motions.
_SEARCHED = ("seek", "tube_damping")
_OPEN = {
    "rivers": (("stiffness", "damping"), RIVER_GAINS),
    "stretch": (_SEARCHED, SEARCH),
    "stretch-then-follow": (_SEARCHED, SEARCH),
}


def resolved(config: RunConfig) -> RunConfig:
    """A configuration with all that its parts leave open written out."""
    left: dict[str, float] = {}
    if config.mode.kind in _OPEN:
        names, values = _OPEN[config.mode.kind]
        numbers = values["file" if config.map.kind == "file" else "default"]
        left = {name: n for name, n in zip(names, numbers, strict=True) if getattr(config.mode, name) is None}
    return replace(config, mode=replace(config.mode, **left))


def river_gains(mode: Rivers) -> tuple[float, float]:
    """k_r [N/m] and b_d [N s/m], by default those of rivers about a circle."""
    stiffness, damping = RIVER_GAINS["default"]
    return mode.stiffness or stiffness, mode.damping or damping


def tube_gains(mode: Stretch | StretchThenFollow) -> tuple[float, float]:
    """k_f [N/m] and damping [N s/m] of a tube, by default those about a circle."""
    seek, damping = SEARCH["default"]
    return seek if mode.seek is None else mode.seek, damping if mode.tube_damping is None else mode.tube_damping
