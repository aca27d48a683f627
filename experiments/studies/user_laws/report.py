"""Report on all laws of movement: the table with the published intervals, and a figure for each experiment."""

import itertools
from dataclasses import asdict
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from controllers.errors import ParameterError
from experiments.files.figure_files import save_figure
from experiments.files.json_text import json_text
from experiments.studies.user_laws.aiming import fitts, scatter
from experiments.studies.user_laws.holding import grip, step_response, tremor
from experiments.studies.user_laws.law import Law, Study
from experiments.studies.user_laws.practice import endurance, practice
from experiments.studies.user_laws.tracing import power_law, steering
from geometry.whole_files import write_text
from sim.users.person.person import Person
from sim.users.person.population import population

STUDIES = {
    "fitts": fitts, "scatter": scatter, "steering": steering, "power-law": power_law, "tremor": tremor,
    "step-response": step_response, "grip": grip, "practice": practice, "endurance": endurance,
}  # fmt: skip
TABLE = "laws.json"
_MAX_AGE = 40.0  # [years] of the published panels, which are of young adults


def user_laws(people: int, seed: int, names: tuple[str, ...]) -> list[Study]:
    """Run the experiments with a population, given by its number of people and its seed.

    Raises
    ------
    ParameterError
        If there is no experiment of that name.
    SimError
        If there are no people.
    """
    unknown = [name for name in names if name not in STUDIES]
    if unknown:
        raise ParameterError(f"no law {unknown[0]!r}; there are {', '.join(STUDIES)}")
    panel = young_adults(people, seed)
    return [STUDIES[name](panel, seed) for name in names or tuple(STUDIES)]


def young_adults(people: int, seed: int) -> tuple[Person, ...]:
    """The first `people` people of at most 40 years in the population of a seed, as in the published panels.

    Raises
    ------
    SimError
        If there are no people.
    """
    population(people, seed)  # refuses a number of people that is none
    adults = (
        tuple(p for p in population(n, seed) if p.age <= _MAX_AGE) for n in itertools.count(2 * people, 2 * people)
    )
    return next(young[:people] for young in adults if len(young) >= people)


def laws_into(out: Path, people: int, seed: int, names: tuple[str, ...], overwrite: bool) -> list[Law]:
    """Run the experiments, and write table and figures into a folder.

    Raises
    ------
    ParameterError
        If the folder holds a table already, or there is no law of that name.
    SimError
        If there are no people.
    """
    if (out / TABLE).exists() and not overwrite:
        raise ParameterError(f"{out} holds a table of laws already; choose another --out, or give --overwrite")
    studies = user_laws(people, seed, names)
    out.mkdir(parents=True, exist_ok=True)
    laws = [law for study in studies for law in study.laws]
    rows = [asdict(law) | {"holds": law.holds} for law in laws]
    write_text(out / TABLE, json_text({"people": people, "seed": seed, "laws": rows}) + "\n")
    for study in studies:
        draw(study, out / f"{study.key}.png")
    return laws


def lines(laws: list[Law]) -> list[str]:
    """The table as text."""
    rows = [("", "here", "published", "", "source")]
    for law in laws:
        value = f"{law.value:.3g} {law.unit}".strip()
        note = ("holds" if law.holds else "DOES NOT HOLD") + (", built in" if law.built_in else "")
        rows.append((law.name, value, f"{law.least:g} to {law.most:g} {law.unit}".strip(), note, law.source))
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    return ["  ".join([*(row[i].ljust(widths[i]) for i in range(4)), row[4]]).rstrip() for row in rows]


def draw(study: Study, path: Path) -> None:
    """Draw the figure of one experiment."""
    figure, axes = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
    axes.plot(study.x, study.y, "-" if study.joined else "o", ms=4.0 if len(study.x) > 40 else 6.0, color="tab:blue")
    if study.line is not None:
        slope, intercept = study.line
        x = np.geomspace(*_data_range(study.x)) if study.log else np.linspace(*_data_range(study.x))
        y = np.exp(intercept) * x**slope if study.log else slope * x + intercept
        axes.plot(x, y, "-", color="tab:orange", label="fit")
        axes.legend()
    if study.log:
        axes.set_xscale("log")
        axes.set_yscale("log")
    text = "\n".join(f"{law.name.split(': ')[1]} {law.value:.3g} {law.unit} ({law.least:g} to {law.most:g})"
                     for law in study.laws)  # fmt: skip
    axes.set_title(f"{study.title}\n{text}", fontsize=9)
    axes.set_xlabel(study.labels[0])
    axes.set_ylabel(study.labels[1])
    axes.grid(alpha=0.3, which="both")
    save_figure(figure, path, dpi=110)
    plt.close(figure)


def _data_range(x: np.ndarray) -> tuple[float, float]:
    return float(np.min(x)), float(np.max(x))
