"""Defaults of a mode that depend on the kind of map.

Imports only configurations, since certificates import it too.
"""

from collections.abc import Mapping
from dataclasses import replace

from experiments.config.maps import MapFile
from experiments.config.modes import Follow, Rivers, Stretch, StretchThenFollow
from experiments.config.run_config import RunConfig

RIVER_GAINS = {"default": (150.0, 16.0), "file": (50.0, 20.0)}
"""k_r [N/m] and b_d [N s/m] of the rivers about a circle, and of a map from a file."""
# Rivers of a map from a file lie side by side. A larger τ = b_d/k_r draws a hand over from one to the other more
# slowly; otherwise the figure would have to reach the other clip's speed at once.
SEARCH = {"default": (150.0, 14.0), "file": (50.0, 20.0)}
"""k_f [N/m] and damping [N s/m] of stretchy tubes."""
# About a circle an edit that is undone takes the hand along in a tenth of a second, not in a fortieth. On a map from a
# file the seeking spring is as soft as the rivers there: the figure follows every movement of the hand, and
# neighbouring curves hold different motions.
_FLOW = {"default": ("curve",), "file": ("parallel",)}
"""Flow of FOLLOW."""
# On a map from a file a hand that is pushed is among other clips, and flights bear no change of pace as well.
_SEARCHED = ("seek", "tube_damping")
_OPEN: dict[type, tuple[tuple[str, ...], Mapping[str, tuple[float | str, ...]]]] = {
    Follow: (("flow",), _FLOW),
    Rivers: (("stiffness", "damping"), RIVER_GAINS),
    Stretch: (_SEARCHED, SEARCH),
    StretchThenFollow: (_SEARCHED, SEARCH),
}


def resolved(config: RunConfig) -> RunConfig:
    """A configuration with the gains and the flow that it leaves open filled in."""
    left: dict[str, float | str] = {}
    if type(config.mode) in _OPEN:
        names, values = _OPEN[type(config.mode)]
        chosen = values["file" if isinstance(config.map, MapFile) else "default"]
        left = {name: x for name, x in zip(names, chosen, strict=True) if getattr(config.mode, name) is None}
    return replace(config, mode=replace(config.mode, **left))


def river_gains(mode: Rivers) -> tuple[float, float]:
    """k_r [N/m] and b_d [N s/m] of rivers; what is not set has the default about a circle."""
    stiffness, damping = RIVER_GAINS["default"]
    return mode.stiffness or stiffness, mode.damping or damping


def tube_gains(mode: Stretch | StretchThenFollow) -> tuple[float, float]:
    """k_f [N/m] and damping [N s/m] of a tube; what is not set has the default about a circle."""
    seek, damping = SEARCH["default"]
    return seek if mode.seek is None else mode.seek, damping if mode.tube_damping is None else mode.tube_damping
