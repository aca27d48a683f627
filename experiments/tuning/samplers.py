"""Samplers that propose candidates: those of optuna, made anew for each candidate."""

from collections.abc import Callable

import numpy as np
import optuna

REFUSED_MOST = 30  # proposals per candidate to simulate; a space that needs more has hardly a certified point
STARTUP = 10  # candidates drawn at random before a sampler begins to learn from results


def sampler_of(name: str, seed: int, number: int) -> optuna.samplers.BaseSampler:
    """The sampler of the candidate with a number; a search that was interrupted continues as it would have.

    A sampler's state is the study's results, which are stored, and its seed, which depends on the number.
    """
    mixed = int(np.random.SeedSequence((seed, *name.encode(), number)).generate_state(1, np.uint32)[0])
    makers: dict[str, Callable[[], optuna.samplers.BaseSampler]] = {
        "tpe": lambda: optuna.samplers.TPESampler(seed=mixed, multivariate=True, n_startup_trials=STARTUP),
        "cma-es": lambda: optuna.samplers.CmaEsSampler(seed=mixed, n_startup_trials=STARTUP),
        "nsga-ii": lambda: optuna.samplers.NSGAIISampler(seed=mixed, population_size=STARTUP),
        "random": lambda: optuna.samplers.RandomSampler(seed=mixed),
    }
    return makers[name]()
