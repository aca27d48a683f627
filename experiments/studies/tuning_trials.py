"""Replications of a tuning and its baselines: the gain on held-back users, with a new search and new people each time.

``python -m experiments.studies.tuning_trials examples/studies/tune.toml runs/tunings 8 17`` runs replications 8 to 17
of the tuning, each in its own folder, and continues where it was interrupted.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.trials.analysis.mixed_model import CONFIDENCE_LEVEL
from experiments.tuning.tune_config import TuneConfig, read_tuning
from experiments.tuning.tuning import Comparison, Tuned, run_tuning
from geometry.arrays import Array


def replication(config: TuneConfig, number: int) -> TuneConfig:
    """The same tuning with another seed of search and trials, and with people of its own.

    The first replication has the people of the file; all panels and held-back users are different populations.
    """
    further = 2 * (number - 1)
    panel, held_back = (replace(users, seed=users.seed + further) for users in (config.users, config.held_back))
    return replace(config, seed=number, users=panel, held_back=held_back)


def lines(found: Sequence[Tuned]) -> list[str]:
    """Chosen values of each replication, and for each contender and objective the gains with their mean, in words."""
    lines = [_chosen_line(one) for one in found]
    for first in found[0].comparisons:
        name = (first.contender, first.objective)
        of = [c for one in found for c in one.comparisons if (c.contender, c.objective) == name]
        own = ", ".join(map(_gain, of))
        if len(of) == 1:
            lines.append(f"{name[1]} against {name[0]}, one replication: better by {own}")
            continue
        gains = np.array([c.better_by for c in of])
        low, high = t_interval(gains)
        lines.append(
            f"{name[1]} against {name[0]}: better by {np.mean(gains):.3g} (95 % interval {low:.3g} to {high:.3g} over "
            f"{len(of)} replications), in {np.sum(gains > 0.0)} of them, by its own interval in "
            f"{sum(c.low > 0.0 for c in of)}: {own}"
        )
    return lines


def _gain(one: Comparison) -> str:
    """Gain of one replication in words, with its interval where its users were enough for one."""
    return f"{one.better_by:.3g}" + (f" ({one.low:.3g} to {one.high:.3g})" if np.isfinite(one.low) else "")


def t_interval(values: Array) -> tuple[float, float]:
    """Student's interval of the mean of two or more values, as a bootstrap's is too narrow for a few replications."""
    from scipy.stats import t

    half = (
        float(t.ppf(0.5 + 0.5 * CONFIDENCE_LEVEL, len(values) - 1)) * float(np.std(values, ddof=1)) / len(values) ** 0.5
    )
    return float(np.mean(values)) - half, float(np.mean(values)) + half


def _chosen_line(one: Tuned) -> str:
    best = next(c for c in one.candidates if c.state == "tried" and c.values == one.values)
    margin = "no margin" if best.margin is None else f"margin {best.margin:.3g}"
    values = ", ".join(f"{word} {value:.4g}" for word, value in one.values.items())
    return f"{one.folder.name}: {values}; {best.verdict}, {margin}"


if __name__ == "__main__":
    _, file, folder, first, last = sys.argv
    config, numbers = read_tuning(Path(file)), range(int(first), int(last) + 1)
    print("\n".join(lines([run_tuning(replication(config, n), Path(folder) / f"{n}") for n in numbers])))
