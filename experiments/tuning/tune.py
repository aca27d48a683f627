"""Tuning of a simulation from Python: any of its parameters, by any cost, among certified candidates only."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from controllers.certificates.report import hash_of
from controllers.checks import check_callable, check_field_types, check_kind, numbers_of
from controllers.errors import ParameterError
from controllers.fields.algebra.description import code_digest, described
from controllers.haptic_map.base import HapticMap
from experiments.certify.certify_simulation import certify
from experiments.config.keywords import with_keyword_messages
from experiments.files.given_path import given_path
from experiments.runs.run_result import Run
from experiments.runs.simulation import Simulation, User
from experiments.runs.sweep import with_values
from experiments.trials.design.plan import code_hash
from experiments.trials.design.study_config import MAX_TRIALS, check_trials
from experiments.tuning.tune_config import Sampler
from geometry.arrays import Array

Cost = Callable[[Run], float | Sequence[float]]


@dataclass(frozen=True)
class Search:
    """Settings of a search.

    Parameters
    ----------
    candidates : int
        Number of candidates to simulate.
    sampler : {"tpe", "cma-es", "nsga-ii", "random"}
        Sampler that proposes them.
    costs : int
        Number of values that the cost returns; if more than one, a Pareto front is sought.
    threads : int
        Number of simultaneous runs.
    allow_unknown : bool
        Also try candidates whose stability is unknown; refuted ones are never tried.
    journal : path or URL, optional
        Storage from which the search can be continued: a file, or a database such as ``sqlite:///``.
    seed : int
        Seed of the search.

    Raises
    ------
    ParameterError
        If a value is of another kind, or a number out of its interval.
    """

    candidates: int = 30
    sampler: Sampler = "tpe"
    costs: int = 1
    threads: int = 1
    allow_unknown: bool = False
    journal: str | Path | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        check_field_types(self)
        for name in ("candidates", "costs", "threads"):
            if not 1 <= getattr(self, name) <= MAX_TRIALS:
                raise ParameterError(f"{name} is {getattr(self, name)}; expected 1 to {MAX_TRIALS}")
        if not 0 <= self.seed < 2**63:
            raise ParameterError(f"seed is {self.seed}; expected 0 or more and less than {2**63}")
        if self.journal is not None:
            given_path("journal", self.journal)


@dataclass(frozen=True)
class TunedSimulation:
    """Result of tuning a simulation.

    Attributes
    ----------
    sim : Simulation
        The simulation with the best values set; for several costs, those of the front nearest to the least of each,
        which are scaled to their ranges over the candidates.
    values : dict of str to float
        These values, by path.
    costs : tuple of float
        Their costs, means over the panel.
    front : tuple of (dict, tuple)
        Values and costs of all candidates on the Pareto front.
    tried, refused : int
        Number of candidates that were simulated, and number that the certificate refused.
    """

    sim: Simulation
    values: dict[str, float]
    costs: tuple[float, ...]
    front: tuple[tuple[dict[str, float], tuple[float, ...]], ...]
    tried: int
    refused: int


@with_keyword_messages()
def tune(
    sim: Simulation, space: Mapping[str, tuple[float, float]], cost: Cost, panel: Sequence[User] = (),
    seconds: float = 6.0, search: Search | None = None,
) -> TunedSimulation:  # fmt: skip
    """Find the parameters of a simulation that minimise a cost; candidates that the certificate refutes are not tried.

    Parameters
    ----------
    sim : Simulation
        Simulation with the values of all other parameters.
    space : mapping of str to (float, float)
        Lowest and highest value by path of the parameter, as in `hvf.sweep`: ``{"field.k_r": (50, 2000)}``.
    cost : callable
        Function of a run that returns the cost to minimise, or several costs whose Pareto front is sought.
    panel : sequence of User
        Users who try each candidate; costs are means over them. By default the simulation's own user.
    seconds : float
        Simulated time of each run [s].
    search : Search, optional
        Settings of the search.

    Raises
    ------
    ParameterError
        If the space is empty, or has an unknown parameter, an invalid range or a bound that a parameter cannot have; if
        none of its candidates may be tried; or if a cost is not a finite number.
    """
    import optuna  # an optional dependency, which takes half a second to import

    from experiments.tuning.search import MAX_PROPOSALS_RATIO, nearest_to_ideal, sampler_of

    check_kind("sim", sim, Simulation)
    check_kind("panel", panel, Sequence[User])
    check_kind("seconds", seconds, float)
    check_kind("search", search, Search | None)
    check_callable("cost", cost, "a run")
    search, users = search or Search(), tuple(panel) or (sim.user,)
    check_trials("tuning", search.candidates * len(users), f"{search.candidates} candidates, {len(users)} users")
    _check_space(sim, space)
    # A session in the middle of the space compiles the units before any run.
    with_values(sim, {path: 0.5 * (low + high) for path, (low, high) in space.items()}).session(seconds)
    study = _create_study(search, _study_name(sim, space, cost, users, seconds, search))
    complete, pruned = optuna.trial.TrialState.COMPLETE, optuna.trial.TrialState.PRUNED
    ranges = {path: optuna.distributions.FloatDistribution(low, high) for path, (low, high) in space.items()}
    for number in range(len(study.trials), MAX_PROPOSALS_RATIO * search.candidates):
        if len(study.get_trials(states=(complete,))) >= search.candidates:
            break
        study.sampler = sampler_of(search.sampler, search.seed, number)
        trial = study.ask(ranges)
        candidate = with_values(sim, trial.params)
        verdict = certify(candidate).stability.verdict
        allowed = verdict == "certified" or (verdict == "unknown" and search.allow_unknown)
        trial.set_constraint("certificate", 0.0 if allowed else 1.0)
        if allowed:
            study.tell(trial, _mean_costs(candidate, users, cost, seconds, search, trial.params))
        else:
            study.tell(trial, state=pruned)
    tried = [trial.values for trial in study.get_trials(states=(complete,))]
    refused = len(study.get_trials(states=(pruned,)))
    if not tried:
        raise ParameterError(f"none of {refused} candidates is certified; expected a space with some, or allow_unknown")
    front = tuple((dict(t.params), tuple(t.values)) for t in study.best_trials)
    values, costs = front[nearest_to_ideal(np.array([costs for _, costs in front]), np.array(tried))]
    return TunedSimulation(with_values(sim, values), values, costs, front, len(tried), refused)


def _check_space(sim: Simulation, space: Mapping[str, tuple[float, float]]) -> None:
    """Refuse a space without parameters, an invalid range, and a bound that a parameter cannot have."""
    check_kind("space", space, Mapping)
    if not space:
        raise ParameterError('the space is empty; expected a range for a parameter or more: {"field.k_r": (50, 2000)}')
    for path, bounds in space.items():
        check_kind("a path of the space", path, str)
        check_kind(path, bounds, Sequence[float])
        if len(bounds) != 2 or not -np.inf < bounds[0] < bounds[1] < np.inf:
            raise ParameterError(f"{path} is {bounds!r}; expected the lowest and the highest value, both finite")
    for edge in range(2):
        with_values(sim, {path: bounds[edge] for path, bounds in space.items()})


def _study_name(
    sim: Simulation, space: Mapping[str, tuple[float, float]], cost: Cost, users: Sequence[User], seconds: float,
    search: Search,
) -> str:  # fmt: skip
    """Name of a search in its journal; it depends on all that a cost depends on, so that no two searches are mixed up.

    Of a user-defined map only the name of its class counts.
    """
    given = sim.haptic_map
    haptic_map = given if is_dataclass(given) and not isinstance(given, HapticMap) else type(given).__name__
    parts = (sim.field, haptic_map, sim.device, sim.figure, sim.clock, sim.seed, sim.tank, tuple(users))
    settings = (search.sampler, search.seed, search.costs, search.allow_unknown, code_hash(__name__))
    return f"hvf.tune {hash_of((described(parts), sorted(space.items()), code_digest(cost), seconds, settings))}"


def _create_study(search: Search, name: str) -> Any:
    import optuna

    from experiments.tuning.search import storage_of

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    storage = None if search.journal is None else storage_of(search.journal)
    directions: list[Literal["minimize", "maximize"]] = ["minimize"] * search.costs
    return optuna.create_study(storage=storage, study_name=name, load_if_exists=True, directions=directions)


def _mean_costs(
    candidate: Simulation, users: Sequence[User], cost: Cost, seconds: float, search: Search, values: Mapping[str, Any]
) -> list[float]:  # fmt: skip
    """Costs of a candidate, means over the users."""

    def run(user: User) -> Run:
        return replace(candidate, user=user).run(seconds)

    with ThreadPoolExecutor(max(1, search.threads)) as pool:
        costs = [_finite_costs(cost(run), search.costs, values) for run in pool.map(run, users)]
    return [float(mean) for mean in np.mean(costs, axis=0)]


def _finite_costs(cost: object, count: int, values: Mapping[str, Any]) -> Array:
    """The cost of a run as `count` finite numbers; anything else is refused, with the values of the candidate."""
    with suppress(ParameterError):
        costs = np.atleast_1d(numbers_of("the cost", cast(Any, cost)))
        if costs.shape == (count,) and np.all(np.isfinite(costs)):
            return costs
    raise ParameterError(
        f"the cost at {dict(values)} is {cost!r}; expected {count} finite number{'s' if count > 1 else ''}"
    )
