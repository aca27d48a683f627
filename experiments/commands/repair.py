"""``hvf repair``: the nearest motion whose flights can be flown."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from experiments.console.output import Json, say
from experiments.console.progress import working


@dataclass(frozen=True)
class Command:
    """Write the nearest motion whose flights can be flown."""

    source: Positional[Path]
    """Motion file to read."""
    target: Positional[Path]
    """BVH file to write."""
    overwrite: bool = False
    """Replace the target if it exists."""
    json: Json = False

    def __call__(self) -> int:
        """Repair the motion, and report what was changed."""
        from experiments.flights.repair import repair_file

        with working("repairing"):
            repaired = repair_file(self.source, self.target, self.overwrite)
        say({"lines": repaired.lines()}, self.json)
        return 0
