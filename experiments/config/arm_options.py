"""Options of a run of the robot arm as the command line takes them: those given change the configuration of a file."""

from collections.abc import Iterator
from dataclasses import fields, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, cast, get_type_hints

import tyro

from experiments.config.part import from_file
from experiments.config.run_config import ArmConfig, Clock
from experiments.config.words import CONFIG_HELP, option, parameters, plain


def _options() -> Iterator[tuple[str, Any, Any]]:
    """Fields of the options' dataclass: those of the configuration and of its clock, None unless given."""
    yield option("config", Path | None, CONFIG_HELP, None)
    for cls in (ArmConfig, Clock):
        hints, help_of = get_type_hints(cls), parameters(cls)
        for name, known in cast(Any, cls).__pydantic_fields__.items():
            if name != "clock":
                yield option(name, plain(hints[name]), f"{help_of[name]} Default: {known.default}.", None)


ArmOptions = make_dataclass("ArmOptions", list(_options()), frozen=True)
"""The options of a run of the arm; all may be left out."""
Options = Annotated[ArmOptions, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="run")]  # pyright: ignore
"""The same for a command that has them among its own."""


def arm_config_of_options(options: object) -> ArmConfig:
    """The configuration that options ask for; those that are given change the one of ``--config``.

    Raises
    ------
    ParameterError, SimError
        If a number is out of its interval, or the file holds no configuration of the arm.
    """
    given = {f.name: getattr(options, f.name) for f in fields(cast(Any, options))}
    given = {name: value for name, value in given.items() if value is not None}
    file = given.pop("config", None)
    config = ArmConfig() if file is None else from_file(ArmConfig, file)
    clock = {f.name: given.pop(f.name) for f in fields(cast(Any, Clock)) if f.name in given}
    return replace(config, clock=replace(config.clock, **clock), **given)
