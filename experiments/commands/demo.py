"""``hvf demo``: a run that shows the main features."""

from dataclasses import dataclass
from pathlib import Path

from experiments.console.output import Json, say
from experiments.console.startup import STARTED


@dataclass(frozen=True)
class Command:
    """The four-clip cylinder of the paper's Fig. 3: two relaxed laps, then one with pushes outwards and inwards."""

    out: Path = Path("runs/demo")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    json: Json = False

    def __call__(self) -> int:
        """Run."""
        from experiments.runs.demo import demo_config
        from experiments.runs.run import run

        say(run(demo_config(), self.out, self.overwrite, STARTED), self.json)
        return 0
