"""``hvf bench``: speed, as ratios."""

from dataclasses import dataclass

from experiments.working import working


@dataclass(frozen=True)
class Command:
    """Measure speed, as ratios within one run."""

    def __call__(self) -> int:
        """Measure."""
        from experiments.studies.benchmarks import bench

        with working("measuring speed"):
            bench()
        return 0
