"""Benchmarks of speed, as ratios measured within one run: ``make bench``."""

from collections.abc import Iterator, Mapping

from experiments.bench.kernel_costs import (
    closest_point_microseconds,
    lifted_microseconds,
    map_microseconds,
    walls_microseconds,
)
from experiments.bench.part_costs import (
    heaviest_field,
    picture_microseconds,
    prepare_cost,
    recorder_cost,
    tick_microseconds,
)
from experiments.bench.process_costs import (
    certificate_seconds,
    command_cost,
    libraries_cost,
    lifting_seconds,
    recompilation_ratio,
    second_start_seconds,
)
from experiments.bench.results import BenchmarkResult
from experiments.bench.tick_cost import MODES, PHYSICS_STEP, TickCost, figure_cost, thread_scaling, tick_cost
from experiments.bench.trial_cost import trial_cost
from experiments.config.options import run_config
from experiments.setups.parts.clips import load_clips
from experiments.setups.session import Session
from experiments.setups.wiring import wire


def benchmark_results() -> Iterator[BenchmarkResult]:
    """Yield every result with its bounds as it is measured; bounds are ratios within one run.

    The unit `mj_steps` is the time of a bare `mj_step` of the demo's world on this machine.
    """
    costs = {name: tick_cost(make()) for name, make in MODES.items()}
    step = costs["follow"].step
    yield from _tick_results(costs)
    yield from _run_results()
    yield from _kernel_results(step)
    yield from _process_results(step)
    per_second, per_simulated = prepare_cost()
    yield BenchmarkResult("preparing captures, processor time", per_second, "× the clips' duration", at_most=6.0)
    yield BenchmarkResult("preparing captures, against simulating their figure", per_simulated, "× the processor time")


def _tick_results(costs: Mapping[str, TickCost]) -> Iterator[BenchmarkResult]:
    speed = PHYSICS_STEP / costs["follow"].tick
    yield BenchmarkResult("simulated seconds per second, physics and servo at 1 kHz, figure at 500 Hz", speed)
    yield BenchmarkResult("microseconds of a bare mj_step of the world", 1e6 * costs["follow"].step)
    for name, cost in costs.items():
        yield BenchmarkResult(f"a closed-loop tick, {name}", cost.tick / cost.step, "mj_steps", at_most=1.5)
    default = tick_cost(run_config())
    yield BenchmarkResult("simulated seconds per second, default clock", 1e-3 / default.tick)
    yield BenchmarkResult("a closed-loop tick of the default clock, two steps", default.tick / default.step, "mj_steps")
    agrees = all(cost.same for cost in (*costs.values(), default))
    yield BenchmarkResult(
        "runs whose replayed controls give the same states, bit for bit, of all", float(agrees), at_least=1.0
    )
    cost = figure_cost()
    yield BenchmarkResult(
        "kinematic figure, against the physical one", cost.physical / cost.kinematic, "× as fast", at_least=3.0
    )
    yield BenchmarkResult("no figure, against the physical one", cost.physical / cost.none, "× as fast", at_least=5.0)
    yield BenchmarkResult("a tick without figure", cost.none / cost.bare_step, "mj_steps of the linkage", at_most=3.0)


def _demo() -> Session:
    config = run_config()
    return wire(config, load_clips(config.map.clips)[0])


def _run_results() -> Iterator[BenchmarkResult]:
    yield BenchmarkResult("two threads / twice one thread", thread_scaling(_demo), at_least=0.9)
    recorder = recorder_cost()
    yield BenchmarkResult(
        "a run with its recorder, against one without", recorder.ratio, "× the processor time", at_most=1.15
    )
    yield BenchmarkResult("memory after 20 s recorded / before", recorder.grown, at_most=1.02)


def _in_mj_steps(name: str, microseconds: float, step: float, bound: float) -> BenchmarkResult:
    return BenchmarkResult(name, 1e-6 * microseconds / step, "mj_steps", at_most=bound)


def _kernel_results(step: float) -> Iterator[BenchmarkResult]:
    small, large = closest_point_microseconds(10), closest_point_microseconds(10_000)
    yield BenchmarkResult("closest point, 10 → 10 000 pieces", large / small, "×", at_most=3.0)
    heaviest = tick_microseconds(*heaviest_field())
    yield _in_mj_steps("ten rivers of higher order, with the limiter", heaviest, step, 0.3)
    yield _in_mj_steps("soft walls of 17 joints", walls_microseconds(_demo()), step, 0.5)
    yield _in_mj_steps("h(p) with h_* over four clips", map_microseconds(_demo()), step, 1.0)
    four, ten, hundred = (lifted_microseconds(m) for m in (4, 10, 100))
    yield _in_mj_steps("lifted map, h(p) with h_*, four clips near", four, step, 1.0)
    yield BenchmarkResult("lifted map, 10 → 100 clips", hundred / ten, "×", at_most=2.0)
    yield _in_mj_steps("a picture of the live page", picture_microseconds(_demo()), step, 100.0)


def _process_results(step: float) -> Iterator[BenchmarkResult]:
    trials = trial_cost()
    yield BenchmarkResult("a study beside its trials, processor time", 100 * trials.overhead, "%", at_most=5.0)
    yield BenchmarkResult("trials on two threads / twice one", trials.scaling, at_least=0.9)
    yield BenchmarkResult("memory after 2000 short trials / after 400", trials.grown, at_most=1.01)
    libraries = libraries_cost()
    yield BenchmarkResult(
        "second start of hvf to its first tick", second_start_seconds() / libraries.clock, "× its libraries",
        at_most=3.0,
    )  # fmt: skip
    yield BenchmarkResult(
        "second start of a study to its first row", trials.start / libraries.clock, "× its libraries", at_most=3.0
    )
    yield BenchmarkResult(
        "recompilation after a change in one law / a cold start, processor time", recompilation_ratio(), at_most=0.1
    )
    shown = command_cost("--help").processor / libraries.processor
    yield BenchmarkResult("hvf --help, processor time", shown, "× its libraries", at_most=1.5)
    certified, verified = certificate_seconds()
    yield _in_mj_steps("certificate of the demo, processor time", 1e6 * certified, step, 100_000)
    yield BenchmarkResult(
        "a certificate verified, processor time", verified / libraries.processor, "× its libraries", at_most=2.0
    )
    yield _in_mj_steps(
        "ten clips of 10 s lifted, with the report, processor time", 1e6 * lifting_seconds(), step, 900_000
    )
