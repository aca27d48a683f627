"""Tuning against its baselines over several seeds of the search: what is gained on held-back users, every time anew.

``python -m experiments.studies.tuning_trials examples/studies/tune.toml runs/tunings 5`` runs the tuning with the seeds
1 to 5, each in a folder of its own, and goes on where it was stopped.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.tuning.contenders import interval
from experiments.tuning.tune_config import read_tuning
from experiments.tuning.tuning import Tuned, run_tuning


def tuning_trials(tuning: Path, out: Path, seeds: Sequence[int]) -> list[Tuned]:
    """Run a tuning with each seed of the search and of the trials, on the panel and the held-back users of its file."""
    config = read_tuning(tuning)
    return [run_tuning(replace(config, seed=seed), out / f"seed-{seed}") for seed in seeds]


def told(found: Sequence[Tuned]) -> list[str]:
    """A line for each contender and objective: the gain by seed, and its mean with a bootstrap interval over seeds."""
    lines: list[str] = []
    for first in found[0].comparisons:
        name = (first.contender, first.objective)
        of = [c for one in found for c in one.comparisons if (c.contender, c.objective) == name]
        gains, shown = np.array([c.better_by for c in of]), sum(c.low > 0.0 for c in of)
        low, high = interval(gains, 1)
        lines.append(
            f"{name[1]} against {name[0]}: better by {np.mean(gains):.3g} ({low:.3g} to {high:.3g} over {len(of)} "
            f"searches), shown by {shown} of them alone: "
            + ", ".join(f"{c.better_by:.3g} ({c.low:.3g} to {c.high:.3g})" for c in of)
        )
    return lines


if __name__ == "__main__":
    print("\n".join(told(tuning_trials(Path(sys.argv[1]), Path(sys.argv[2]), range(1, 1 + int(sys.argv[3]))))))
