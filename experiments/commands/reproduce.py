"""``hvf reproduce``: a recorded run repeated and compared bit for bit."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from experiments.console.output import Json, say
from experiments.console.progress import working


@dataclass(frozen=True)
class Command:
    """Run a recording's configuration again and compare, bit for bit."""

    folder: Positional[Path]
    """Folder of a run."""
    json: Json = False

    def __call__(self) -> int:
        """Exit code 0 if every tick is the same, 1 if not."""
        from experiments.runs.reproduce import reproduce

        with working("reproducing"):
            found = reproduce(self.folder)
        say(found, self.json)
        return 0 if found.same else 1
