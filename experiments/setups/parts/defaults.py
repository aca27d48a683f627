"""What a configuration leaves open: gains and flow of a mode, which depend on the kind of map, and the lap."""

import os
from collections.abc import Mapping
from dataclasses import replace

from experiments.config.maps import Composite, MapFile
from experiments.config.modes import Follow, Rivers, Stretch, StretchThenFollow, StretchyTube
from experiments.config.paths import with_paths
from experiments.config.run_config import RunConfig
from experiments.setups.parts.lap import with_lap

# Rivers of a map from a file lie side by side. A larger τ = b_d/k_r draws a hand over from one to the other more
# slowly; otherwise the figure would have to reach the other clip's speed at once.
_RIVER_GAINS, _FILE_RIVER_GAINS = {"stiffness": 150.0, "damping": 16.0}, {"stiffness": 50.0, "damping": 20.0}
# About a circle, an undone edit carries the hand along in a tenth of a second, not in a fortieth. On a map from a
# file the seeking spring is as soft as the rivers there: the figure follows every movement of the hand, and
# neighbouring curves hold different motions.
_TUBE_GAINS, _FILE_TUBE_GAINS = {"seek": 150.0, "tube_damping": 14.0}, {"seek": 50.0, "tube_damping": 20.0}
# On a map from a file a push takes the hand among other clips, and flights tolerate no change of pace as well. On a
# composite a push should change the upper body alone: its legs tolerate no other pace either.
_CURVE_FLOW, _PARALLEL_FLOW = {"flow": "curve"}, {"flow": "parallel"}

_ModeDefaults = Mapping[type, Mapping[str, float | str]]
_CIRCLE_DEFAULTS: _ModeDefaults = {
    Follow: _CURVE_FLOW,
    Rivers: _RIVER_GAINS,
    Stretch: _TUBE_GAINS,
    StretchThenFollow: _TUBE_GAINS,
}
_FILE_DEFAULTS: _ModeDefaults = {
    Follow: _PARALLEL_FLOW,
    Rivers: _FILE_RIVER_GAINS,
    Stretch: _FILE_TUBE_GAINS,
    StretchThenFollow: _FILE_TUBE_GAINS,
}
_DEFAULTS_BY_MAP: Mapping[type, _ModeDefaults] = {
    MapFile: _FILE_DEFAULTS,
    Composite: {**_CIRCLE_DEFAULTS, Follow: _PARALLEL_FLOW},
}


def resolved(config: RunConfig) -> RunConfig:
    """A configuration with full paths, and with the gains, the flow and the lap that it leaves open filled in.

    Raises
    ------
    HvfError
        As `with_lap`.
    """
    config = with_paths(config, os.path.abspath)
    values = _DEFAULTS_BY_MAP.get(type(config.map), _CIRCLE_DEFAULTS).get(type(config.mode), {})
    missing = {name: value for name, value in values.items() if getattr(config.mode, name) is None}
    return replace(config, map=with_lap(config.map), mode=replace(config.mode, **missing))


def river_gains(mode: Rivers) -> tuple[float, float]:
    """k_r [N/m] and b_d [N s/m] of rivers; gains that are not set have their defaults about a circle."""
    return mode.stiffness or _RIVER_GAINS["stiffness"], mode.damping or _RIVER_GAINS["damping"]


def tube_gains(mode: StretchyTube) -> tuple[float, float]:
    """k_f [N/m] and damping [N s/m] of a tube; gains that are not set have their defaults about a circle."""
    return (
        _TUBE_GAINS["seek"] if mode.seek is None else mode.seek,
        _TUBE_GAINS["tube_damping"] if mode.tube_damping is None else mode.tube_damping,
    )
