"""Runs from options in Python: everything that ``hvf run`` can do, with the result in memory."""

import tempfile
from pathlib import Path
from typing import Any, cast

from rich.console import Console

from controllers.errors import ParameterError
from experiments.config.keywords import with_keyword_messages
from experiments.config.options import run_config, with_options
from experiments.config.part import to_dict
from experiments.config.paths import load_config
from experiments.config.run_config import RunConfig
from experiments.console.compiling import compiler
from experiments.console.estimates import check_length
from experiments.files.given_path import given_path
from experiments.runs.run_result import Run, check_record
from experiments.setups.wiring import wire


@with_keyword_messages(out="record")
def run(
    config: str | Path | None = None, *, record: str | Path | None = None, overwrite: bool = False, **words: Any
) -> Run:
    """Run what options ask for, as ``hvf run`` does: any mode, map, hand and figure, clips by name or motion files.

    ``hvf.run(mode="lead", clips=["walk"], seconds=5.0)`` is ``hvf run --mode lead --clips walk --seconds 5``. User-
    defined laws, maps and hands need a `hvf.Simulation`.

    Parameters
    ----------
    config : path, optional
        A configuration in a JSON file, such as that of a recorded run, from whose folder its relative paths start; the
        other options change it.
    record : path, optional
        Folder to write recording, configuration, summary, animations, figures and page into; by default a temporary
        one.
    overwrite : bool
        Replace a run that the folder holds.
    **words
        ``mode``, ``map``, ``user``, ``figure``, ``replay``, ``seconds``, ``seed`` and the options of their parts, named
        as on the command line with underscores; ``pushes``, ``turns`` and ``grabs`` as sequences of `hvf.Push`,
        `hvf.Turn` and `hvf.Grab`.

    Raises
    ------
    HvfError
        If an option is unknown or does not belong to the chosen parts, a number is out of its interval, a file cannot
        be read, or the folder cannot be written or holds a run.
    """
    if "out" in words:
        raise ParameterError("out is an option of the command line; expected record, a folder to write into")
    file = None if config is None else given_path("config", config)
    check_record(record, overwrite)
    given: dict[str, Any] = {
        name: tuple(cast(list[object], value)) if isinstance(value, list) else value for name, value in words.items()
    }
    run_settings = run_config(**given) if file is None else with_options(load_config(file), given)
    check_length(Path(record or tempfile.gettempdir()), run_settings.seconds, run_settings.clock.servo_period)
    console = Console(stderr=True)
    session = wire(run_settings, ready=compiler(console))
    resolved = cast(RunConfig, session.config)
    return Run.of(session, to_dict(resolved), resolved.seconds, record, overwrite)
