"""``hvf bench``: speed, as ratios."""

from dataclasses import dataclass

from experiments.console.output import Json
from experiments.console.progress import working


@dataclass(frozen=True)
class Command:
    """Measure speed, as ratios within one run, each with what it has to keep to."""

    json: Json = False
    check: bool = False
    """Exit with 1 if a figure fails."""

    def __call__(self) -> int:
        """Measure."""
        from experiments.bench.benchmarks import figures
        from experiments.bench.figures import print_figures

        with working("measuring speed"):
            return print_figures(figures(), self.json, self.check)
