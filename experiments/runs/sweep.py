"""Parameter sweeps: a simulation run at many values of its parameters, in parallel threads."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, is_dataclass
from dataclasses import replace as replaced
from typing import Any, NamedTuple, cast

from controllers.checks import check_kind, checked
from controllers.errors import ParameterError
from controllers.fields.algebra.instructions import OP_CODE, OP_PARAMETERS, Join
from controllers.fields.algebra.law import Law, Program
from controllers.fields.own.function_law import FunctionLaw
from experiments.config.keywords import with_keyword_messages
from experiments.runs.run_result import Run
from experiments.runs.short_text import name_of
from experiments.runs.simulation import Simulation
from experiments.setups.wiring import check_seconds

_LIMIT_NAME = "limited"  # the operation `Law.limited`
_LIMIT_UNITS = {"force": "N", "torque": "N m"}  # units of its bounds, in order


class Swept(NamedTuple):
    """One simulation of a sweep.

    Attributes
    ----------
    values : dict
        Values of the swept parameters, by path.
    run : Run
        Result of the run.
    """

    values: dict[str, Any]
    run: Run


@with_keyword_messages()
def sweep(
    sim: Simulation, values: Mapping[str, Sequence[Any]], seconds: float = 10.0, threads: int = 1
) -> Iterator[Swept]:
    """Run a simulation at every combination of values, and yield the runs in the order of the combinations.

    Parameters
    ----------
    sim : Simulation
        Simulation with the values of all other parameters.
    values : mapping of str to sequence
        Values by path of the parameter: ``field.k_r``, ``user.pushes``, ``clock.physics_step``, ``seed``. In a
        composed field a name must belong to one law only; ``field.Follow.k_r`` names the law too. The parameters of a
        user-defined law are reached in the same way, under the name of its function: ``field.floor.k``; the bounds of
        a field that is ``limited`` once as ``field.limited.force`` and ``field.limited.torque``.
    seconds : float
        Simulated time of each run [s].
    threads : int
        Number of simultaneous runs; the compiled loop releases the GIL.

    Raises
    ------
    HvfError
        Before the first run, if there is no such parameter, or several laws have it; it has no values, or one that it
        cannot have; there is no thread; or an argument is of another kind.
    """
    check_kind("sim", sim, Simulation)
    check_kind("values", values, Mapping)
    for path, several in values.items():
        check_kind("a path of values", path, str)
        check_kind(path, several, Sequence[Any])
        if len(several) == 0:
            raise ParameterError(f"{path} has no values; expected one or more")
    check_kind("seconds", seconds, float)
    check_kind("threads", threads, int)
    if threads < 1:
        raise ParameterError(f"threads is {threads}; expected 1 or more")
    combinations = [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]
    simulations = [with_values(sim, chosen) for chosen in combinations]
    for simulation in simulations:
        check_seconds(simulation, seconds)
    return _run_combinations(combinations, simulations, seconds, threads)


def _run_combinations(
    combinations: Sequence[dict[str, Any]], simulations: Sequence[Simulation], seconds: float, threads: int
) -> Iterator[Swept]:
    def run(simulation: Simulation) -> Run:
        return simulation.run(seconds)

    if simulations and threads > 1:
        simulations[0].session(seconds)  # compiles the units once, before the threads begin
    with ThreadPoolExecutor(max(1, threads)) as pool:
        for chosen, result in zip(combinations, pool.map(run, simulations), strict=True):
            yield Swept(chosen, result)


def with_values(sim: Simulation, chosen: Mapping[str, Any]) -> Simulation:
    """The same simulation with parameters set, by path as in `sweep`."""
    for path, value in chosen.items():
        sim = cast(Simulation, _with_parameter(sim, path.split("."), value, path))
    return sim


def _with_parameter(part: Any, names: Sequence[str], value: Any, path: str) -> Any:
    """The same part with one parameter set, which may be nested."""
    if isinstance(part, Program) and names[0] == _LIMIT_NAME:
        return _with_limit(part, names, value, path)
    if isinstance(part, Program):
        law = _owning_law(part, names, path)
        rest = names if len(names) == 1 or name_of(law) != names[0] else names[1:]
        return part.with_law(law, cast(Law, _with_parameter(law, rest, value, path)))
    if isinstance(part, FunctionLaw) and len(names) == 1:
        return part(**{names[0]: value})
    if not is_dataclass(part) or isinstance(part, type) or names[0] not in {f.name for f in fields(part)}:
        if not is_dataclass(part) or isinstance(part, type):
            whole = path.removesuffix("." + ".".join(names))
            raise ParameterError(f"{path}: {whole} is a {type(part).__name__}; expected whole values of {whole}")
        known = ", ".join(f.name for f in fields(part))
        raise ParameterError(f"{path}: {type(part).__name__} has no {names[0]!r}; expected some of {known}")
    new = value if len(names) == 1 else _with_parameter(getattr(part, names[0]), names[1:], value, path)
    return replaced(part, **{names[0]: new})


def _with_limit(program: Program, names: Sequence[str], value: Any, path: str) -> Program:
    """The same field with one bound of its only limit set."""
    limits = [row[OP_PARAMETERS] for row in program.ops.tolist() if row[OP_CODE] == Join.LIMIT]
    if len(names) != 2 or names[1] not in _LIMIT_UNITS or len(limits) != 1:
        expected = " or ".join(f"{_LIMIT_NAME}.{bound}" for bound in _LIMIT_UNITS)
        raise ParameterError(
            f"{path}: the field is limited {len(limits)} times; expected {expected} of one that is once"
        )
    params, place = program.params.copy(), list(_LIMIT_UNITS).index(names[1])
    params[limits[0] + place] = checked(path, value, _LIMIT_UNITS[names[1]], infinite=True)
    return replaced(program, params=params)


def _owning_law(program: Program, names: Sequence[str], path: str) -> Law:
    """The one law of a composed field to which a path refers."""
    wanted = names[0]
    found = [
        law for law in program.laws
        if (name_of(law) == wanted if len(names) > 1 else _has_parameter(law, wanted))
    ]  # fmt: skip
    if len(found) != 1:
        laws = ", ".join(name_of(law) for law in program.laws)
        bounds = f", or {_LIMIT_NAME}" if (program.ops[:, OP_CODE] == Join.LIMIT).any() else ""
        raise ParameterError(
            f"{path}: {len(found)} laws of the field have {wanted!r}; expected one among {laws}{bounds}"
        )
    return found[0]


def _has_parameter(law: Law, number: str) -> bool:
    return number in law.parameters if isinstance(law, FunctionLaw) else hasattr(law, number)
