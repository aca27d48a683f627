"""``hvf arm``: a robot arm in the place of the figure."""

from dataclasses import dataclass
from pathlib import Path

from experiments.config.arm_options import Options, arm_config_of_options
from experiments.console.output import Json, say


@dataclass(frozen=True)
class Command:
    """Let the field lead a robot arm of seven joints instead of the figure, and write what happened into a folder."""

    options: Options  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    """What is run."""
    out: Path = Path("runs/arm")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    json: Json = False

    def __call__(self) -> int:
        """Run."""
        from experiments.runs.run_arm import run_arm

        say(run_arm(arm_config_of_options(self.options), self.out, self.overwrite), self.json)
        return 0
