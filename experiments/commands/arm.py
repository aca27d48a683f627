"""``hvf arm``: a robot arm in the place of the figure."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from experiments.config.run_config import ArmConfig
from experiments.console.output import Json, say


@dataclass(frozen=True)
class Command:
    """Let the field lead a robot arm of seven joints instead of the figure, and write what happened into a folder."""

    config: Annotated[ArmConfig, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="run")] = field(
        default_factory=ArmConfig
    )
    """What is run."""
    out: Path = Path("runs/arm")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    json: Json = False

    def __call__(self) -> int:
        """Run."""
        from experiments.runs.run_arm import run_arm

        say(run_arm(self.config, self.out, self.overwrite), self.json)
        return 0
