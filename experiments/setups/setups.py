"""All set-ups: what each mode and each kind of map makes of a configuration."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco

from experiments.config.modes import Follow, Rivers, StretchThenFollow
from experiments.config.run_config import RunConfig
from experiments.setups.bunny import bunny_laws, bunny_parts
from experiments.setups.certified_law import CertifiedLaw
from experiments.setups.clips import load_clips
from experiments.setups.figure_maps import MAP_SETUPS
from experiments.setups.follow import follow_laws, follow_parts
from experiments.setups.lead import lead_laws, lead_parts, led_parts
from experiments.setups.parts import MapParts, Parts
from experiments.setups.rivers import GAINS, gains, rivers_laws, rivers_parts
from experiments.setups.stretch import (
    DAMPING,
    SEEK,
    SOFT_DAMPING,
    SOFT_SEEK,
    stretch_laws,
    stretch_parts,
    stretch_then_follow_laws,
    stretch_then_follow_parts,
)
from models.mocap.clip import Clip

LANDS = ("file", "rivers", "led")
"""Kinds of map whose clips are played as they are: a foot lands between two updates of the figure."""


def _no_drag(mode: object) -> float:
    return 0.0


def _damping(mode: Follow | StretchThenFollow) -> float:
    return mode.damping


def _river_drag(mode: Rivers) -> float:
    return gains(mode)[1]


class ModeSetup(NamedTuple):
    """What a mode makes of a configuration.

    Attributes
    ----------
    parts : callable
        From configuration, mode and map to the parts of a run.
    laws : callable
        From the mode to the laws that are certified, by what is added to the names of their verdicts; that of the
        run's start by "".
    drag : callable
        From the mode to the damping [N s/m] with which it leads along a curve; 0 where it does not lead.
    soft, firm : dict
        What its options are that were left open, on a map from a file and else.
    """

    parts: Callable[..., Parts]
    laws: Callable[..., dict[str, CertifiedLaw]]
    drag: Callable[..., float] = _no_drag
    soft: dict[str, float] = {}  # noqa: RUF012 - never written
    firm: dict[str, float] = {}  # noqa: RUF012


def _pair(gains: tuple[float, float], names: tuple[str, str]) -> dict[str, float]:
    return dict(zip(names, gains, strict=True))


_K_B, _SEARCH = ("stiffness", "damping"), ("seek", "tube_damping")
_SOFT, _FIRM = _pair((SOFT_SEEK, SOFT_DAMPING), _SEARCH), _pair((SEEK, DAMPING), _SEARCH)
MODE_SETUPS = {
    "follow": ModeSetup(follow_parts, follow_laws, _damping),
    "bunny": ModeSetup(bunny_parts, bunny_laws),
    "rivers": ModeSetup(
        rivers_parts,
        rivers_laws,
        _river_drag,
        _pair(GAINS["file"], _K_B),
        _pair(GAINS["default"], _K_B),
    ),
    "stretch": ModeSetup(stretch_parts, stretch_laws, soft=_SOFT, firm=_FIRM),
    "stretch-then-follow": ModeSetup(stretch_then_follow_parts, stretch_then_follow_laws, _damping, _SOFT, _FIRM),
    "lead": ModeSetup(lead_parts, lead_laws),
}
"""By kind of mode."""
_MAPS: dict[str, Callable[..., MapParts[Any]]] = {**MAP_SETUPS, "led": led_parts}


def resolved(config: RunConfig) -> RunConfig:
    """A configuration with what its parts leave to each other: gains by the kind of map, the figure's updates."""
    setup = MODE_SETUPS[config.mode.kind]
    defaults = setup.soft if config.map.kind == "file" else setup.firm
    left = {name: value for name, value in defaults.items() if getattr(config.mode, name) is None}
    ticks = config.figure.figure_ticks or (2 if config.map.kind in LANDS else 8)
    return replace(config, mode=replace(config.mode, **left), figure=replace(config.figure, figure_ticks=ticks))


def map_parts(config: RunConfig, figure: mujoco.MjModel, clips: tuple[Clip, ...] | None = None) -> MapParts[Any]:
    """What the map of a configuration gives a run: of clips that are given, or those that it names.

    Raises
    ------
    ModelError, ControllerError, SimError
        If there is no such clip, file or curve, or the Phantom does not reach the curve.
    """
    remarks: tuple[str, ...] = ()
    if clips is None:
        clips, remarks = load_clips(config.map.clips)
    return _MAPS[config.map.kind](config, config.map, clips, figure).said(remarks)


def parts_of(config: RunConfig, maps: MapParts[Any]) -> Parts:
    """Parts of a run on a map."""
    return MODE_SETUPS[config.mode.kind].parts(config, config.mode, maps)


def certified_laws(config: RunConfig) -> dict[str, CertifiedLaw]:
    """The laws that a run uses, by what is added to the names of their verdicts; that of the run's start by "".

    Raises
    ------
    ParameterError
        If there is no certificate for them.
    """
    return MODE_SETUPS[config.mode.kind].laws(resolved(config).mode)


def leading_drag(config: RunConfig) -> float:
    """Damping [N s/m] with which a run leads along its curve; 0 where it does not lead."""
    return MODE_SETUPS[config.mode.kind].drag(resolved(config).mode)
