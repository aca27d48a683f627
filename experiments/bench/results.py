"""Benchmark results: measured values with their bounds, printed in words or as JSON."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

from experiments.files.json_text import json_text


@dataclass(frozen=True)
class BenchmarkResult:
    """A measured ratio.

    Attributes
    ----------
    name : str
        What was measured.
    value : float
    unit : str
        Unit of the value, such as ``mj_steps`` or ``×``.
    at_most, at_least : float or None
        Bounds that it must keep; None for both if it is only reported.
    """

    name: str
    value: float
    unit: str = ""
    at_most: float | None = None
    at_least: float | None = None

    @property
    def passes(self) -> bool | None:
        """Whether the value keeps its bounds; None if it has none. NaN does not pass."""
        if self.at_most is None and self.at_least is None:
            return None
        return (self.at_most is None or self.value <= self.at_most) and (
            self.at_least is None or self.value >= self.at_least
        )

    def line(self) -> str:
        """As ``pass  a tick of follow: 1.42 mj_steps (≤ 1.5)``."""
        verdict = {True: "pass", False: "FAIL", None: "    "}[self.passes]
        limits = (("≤", self.at_most), ("≥", self.at_least))
        bounds = [f"{sign} {limit:g}" for sign, limit in limits if limit is not None]
        bounds_text = f" ({', '.join(bounds)})" if bounds else ""
        return f"{verdict}  {self.name}: {self.value:.3g}{' ' * bool(self.unit)}{self.unit}{bounds_text}"


def print_results(results: Iterable[BenchmarkResult], as_json: bool, check: bool) -> int:
    """Print results as they are measured, or all as JSON; returns the exit code, 1 if `check` is set and one fails."""
    printed: list[BenchmarkResult] = []
    for result in results:
        printed.append(result)
        if not as_json:
            print(result.line(), flush=True)
    failed = [result.name for result in printed if result.passes is False]
    if as_json:
        print(json_text([asdict(result) | {"passes": result.passes} for result in printed]))
    elif failed:
        print(f"{len(failed)} of {len(printed)} benchmarks fail: {'; '.join(failed)}")
    return 1 if check and failed else 0
