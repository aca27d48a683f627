"""``hvf bench``: speed, as ratios."""

from dataclasses import dataclass

from experiments.console.output import Json
from experiments.console.progress import working


@dataclass(frozen=True)
class Command:
    """Measure speed, as ratios within one run, each with what it has to keep to."""

    json: Json = False
    check: bool = False
    """Exit with 1 if a result is out of its bounds."""

    def __call__(self) -> int:
        """Measure."""
        from experiments.bench.benchmarks import benchmark_results
        from experiments.bench.results import print_results

        with working("measuring speed"):
            return print_results(benchmark_results(), self.json, self.check)
