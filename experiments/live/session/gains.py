"""Gains of a mode that sliders change during a run."""

from dataclasses import fields, replace
from typing import Any, NamedTuple, cast

from experiments.config.run_config import RunConfig
from experiments.setups.parts.defaults import resolved


class Gain(NamedTuple):
    """A gain of a mode, and the range of its slider.

    Attributes
    ----------
    name, symbol, unit : str
        Name of the mode's attribute, the paper's symbol, and the unit.
    least, most, step : float
        Range and step of the slider, also for typed values.
    """

    name: str
    symbol: str
    unit: str
    least: float
    most: float
    step: float


GAINS = (
    Gain("stiffness", "k_r", "N/m", 10.0, 12000.0, 10.0),
    Gain("damping", "b_d", "N s/m", 0.5, 80.0, 0.5),
    Gain("seek", "k_f", "N/m", 10.0, 12000.0, 10.0),
    Gain("rubber", "k_s", "N/m", 10.0, 12000.0, 10.0),
    Gain("tube_damping", "b", "N s/m", 0.5, 80.0, 0.5),
    Gain("rubber_tube", "ε", "m", 0.002, 0.02, 0.0005),
    Gain("bunny_width", "δ", "m", 0.005, 0.1, 0.001),
    Gain("leash", "k_l", "N/m", 10.0, 1000.0, 10.0),
)
"""Sliders of all gains; the ranges exceed the stable gains, so that the boundary can be seen."""


def gains_of(config: RunConfig) -> dict[Gain, float]:
    """The adjustable gains of a run's mode, with their values."""
    mode = cast(Any, resolved(config).mode)
    names = {option.name for option in fields(mode)}
    return {gain: float(getattr(mode, gain.name)) for gain in GAINS if gain.name in names}


def with_gain(config: RunConfig, name: str, value: float) -> RunConfig:
    """A configuration with another value of a gain.

    Raises
    ------
    ParameterError
        If the value is outside its interval.
    """
    return replace(config, mode=cast(Any, replace)(resolved(config).mode, **{name: value}))
