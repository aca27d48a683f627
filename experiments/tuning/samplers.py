"""Who proposes candidates: optuna's samplers, made anew for each candidate."""

from collections.abc import Callable

import numpy as np
import optuna

STARTUP = 10  # candidates drawn at random before a sampler that learns begins to


def sampler_of(name: str, seed: int, number: int) -> optuna.samplers.BaseSampler:
    """A sampler for the candidate of a number alone: so a search that was stopped goes on as it would have.

    What it learns from is in the study; what else it draws from is its seed.
    """
    mixed = int(np.random.SeedSequence((seed, *name.encode(), number)).generate_state(1, np.uint32)[0])
    makers: dict[str, Callable[[], optuna.samplers.BaseSampler]] = {
        "tpe": lambda: optuna.samplers.TPESampler(seed=mixed, multivariate=True, n_startup_trials=STARTUP),
        "cma-es": lambda: optuna.samplers.CmaEsSampler(seed=mixed, n_startup_trials=STARTUP),
        "nsga-ii": lambda: optuna.samplers.NSGAIISampler(seed=mixed, population_size=STARTUP),
        "random": lambda: optuna.samplers.RandomSampler(seed=mixed),
    }
    return makers[name]()
