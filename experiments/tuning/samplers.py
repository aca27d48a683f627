"""Samplers that propose candidates: those of optuna, made anew for each candidate."""

from collections.abc import Callable

import numpy as np
import optuna

MAX_PROPOSALS_RATIO = (
    30  # maximum of proposals per simulated candidate; if more are needed, hardly any point is certified
)
RANDOM_STARTUP_COUNT = 10  # candidates drawn at random before a sampler begins to learn from results


def sampler_of(name: str, seed: int, number: int) -> optuna.samplers.BaseSampler:
    """The sampler for a candidate by its number; an interrupted search continues as if it had not been interrupted.

    A sampler's state consists of the study's results, which are stored, and its seed, which depends on the number.
    """
    candidate_seed = int(np.random.SeedSequence((seed, *name.encode(), number)).generate_state(1, np.uint32)[0])
    makers: dict[str, Callable[[], optuna.samplers.BaseSampler]] = {
        "tpe": lambda: optuna.samplers.TPESampler(
            seed=candidate_seed, multivariate=True, n_startup_trials=RANDOM_STARTUP_COUNT
        ),
        "cma-es": lambda: optuna.samplers.CmaEsSampler(seed=candidate_seed, n_startup_trials=RANDOM_STARTUP_COUNT),
        "nsga-ii": lambda: optuna.samplers.NSGAIISampler(seed=candidate_seed, population_size=RANDOM_STARTUP_COUNT),
        "random": lambda: optuna.samplers.RandomSampler(seed=candidate_seed),
    }
    return makers[name]()
