"""The plan of a study: a configuration and a key for every trial."""

import hashlib
import os
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.errors import ParameterError
from experiments.config.keywords import to_keywords
from experiments.config.maps import MapFile
from experiments.config.options import run_config
from experiments.config.part import to_json
from experiments.config.paths import with_paths
from experiments.config.run_config import RunConfig, phantom_of
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.lap import with_lap
from experiments.trials.design.design import Condition, DesignTrial, conditions, design_trials
from experiments.trials.design.study_config import StudyConfig, StudyError, Words
from models.errors import ModelError
from models.mocap.library import embedded_names
from sim.compilation.sources import reached_code
from sim.users.person.person import Person
from sim.users.person.population import population

_TRIAL_MODULE = "experiments.trials.trial.run_trial"
_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "llvmlite")


class Trial(NamedTuple):
    """A planned trial.

    Attributes
    ----------
    key : str
        Hash of configuration, seed, files and code.
    design : DesignTrial
        User, condition and position in the design.
    config : RunConfig
        Configuration of the run.
    """

    key: str
    design: DesignTrial
    config: RunConfig


def plan_trials(study: StudyConfig) -> tuple[Trial, ...]:
    """All trials of a study.

    Raises
    ------
    HvfError
        If the design contradicts itself, a level sets a parameter that a run does not have, or a clip does not exist.
    """
    people = population(study.users.number, study.users.seed)
    bases = {number: _base_config(study, people[0], condition) for number, condition in enumerate(conditions(study))}
    _check_used(study)
    _check_distinct(study, bases)
    trials: list[Trial] = []
    for design in design_trials(study):
        base = bases[design.number]
        user = replace(base.user, person=people[design.user])
        # Independent of other trials' seeds, and of the numbers of users and repetitions.
        entropy = (study.seed, design.user, design.number, design.repetition)
        seed = int(np.random.SeedSequence(entropy).generate_state(1, np.uint32)[0])
        config = replace(base, user=user, seed=seed)
        trials.append(Trial(trial_key(config), design, config))
    return tuple(trials)


def trial_key(config: RunConfig) -> str:
    """Hash of a configuration with its seed, of the files that it names, and of the code, 32 hex digits.

    Raises
    ------
    StudyError
        If a file that it names does not exist.
    """
    files = [f"{os.path.basename(name)} {file_digest(name)}" for name in files_of(config)]  # refuses missing ones first
    settings = to_json(with_paths(resolved(config), os.path.basename))  # the same wherever the files are
    return hashlib.sha256("\n".join([code_hash(), settings, *files]).encode()).hexdigest()[:32]


@cache
def code_hash(module: str = _TRIAL_MODULE) -> str:
    """Hash of the code that a trial, or another module, reaches, and of Python and the libraries, 16 hex digits.

    Analysis and plots of a study are not included; nor is the processor, which a row names separately.
    """
    parts = [sys.version_info[:2], [version(name) for name in _LIBRARIES], sorted(reached_code(module).items())]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def files_of(config: RunConfig) -> tuple[str, ...]:
    """Files that a configuration names: clips that are not embedded, the map's, and the device's."""
    clips = tuple(name for name in config.map.clips if name not in embedded_names())
    others = (config.map.file if isinstance(config.map, MapFile) else "", phantom_of(config.device).device_file)
    return clips + tuple(name for name in others if name)


@cache
def file_digest(name: str) -> str:
    """Hash of a file.

    Raises
    ------
    StudyError
        If it does not exist.
    """
    try:
        return hashlib.sha256(Path(name).read_bytes()).hexdigest()
    except OSError as error:
        raise StudyError(
            f"{name}: {error.strerror}; expected the file of a clip, a map or a device, or one of the embedded clips, "
            f"{', '.join(embedded_names())}"
        ) from None


def _base_config(study: StudyConfig, person: Person, condition: Condition) -> RunConfig:
    words: Words = {"person": person, "seconds": study.seconds} | study.run | condition.words
    if words.get("mode") != "lead":  # in LEADING the hand does nothing but lead
        words.setdefault("user", study.users.does)
    try:
        config = run_config(**words)
        # Now and not in each trial: where motion files decide on the lap, they are read.
        return replace(config, map=with_lap(config.map))
    except (ParameterError, ModelError) as error:
        level_text = ", ".join(f"{factor} = {level}" for factor, level in condition.levels.items())
        raise StudyError(f"study {study.name!r}, condition {level_text}: {to_keywords(str(error))}") from None
    except TypeError as error:
        raise StudyError(f"study {study.name!r}: {error}; expected options of a run, as in `hvf run --help`") from None


def _check_used(study: StudyConfig) -> None:
    """Refuse an option of all trials that every condition replaces."""
    for name, value in study.run.items():
        if all(name in condition.words for condition in conditions(study)):
            raise StudyError(
                f"study {study.name!r}: [run] has {name} = {value}, which every condition replaces; expected it "
                "there, or in the levels of a factor"
            )


def _check_distinct(study: StudyConfig, bases: Mapping[int, RunConfig]) -> None:
    """Refuse two conditions that are the same."""
    seen: dict[str, int] = {}
    all_conditions = conditions(study)
    for number, config in bases.items():
        text = to_json(config)
        if text in seen:
            first, second = (" and ".join(all_conditions[k].levels.values()) for k in (seen[text], number))
            raise StudyError(
                f"study {study.name!r}: conditions {first!r} and {second!r} are the same; expected them to differ"
            )
        seen[text] = number
