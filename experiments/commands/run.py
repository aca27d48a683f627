"""``hvf run``: a run from a configuration to a folder."""

from dataclasses import dataclass
from pathlib import Path

from experiments.config.options import Options, config_of_options
from experiments.console.output import Json, say
from experiments.console.startup import STARTED


@dataclass(frozen=True)
class Command:
    """Simulate a hand, a field, a map and a figure, and write the results into a folder."""

    options: Options  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    """What is run."""
    out: Path = Path("runs/run")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    view: bool = False
    """Show the run in a browser while it goes on."""
    json: Json = False

    def __call__(self) -> int:
        """Run."""
        from experiments.runs.run import run

        say(run(config_of_options(self.options), self.out, self.overwrite, STARTED, self.view), self.json)
        return 0
