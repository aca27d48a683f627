"""``hvf arm``: a robot arm in the place of the figure."""

from dataclasses import dataclass
from pathlib import Path

from controllers.errors import ParameterError
from experiments.config.options import Options, config_of_options
from experiments.console.output import Json, say
from experiments.console.startup import STARTED

_DEFAULTS = {"map": "robot-arm", "user": "push", "seconds": 12.0}


@dataclass(frozen=True)
class Command:
    """Let the field lead a robot arm of seven joints: `hvf run --map robot-arm`, with a hand that pushes."""

    options: Options  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    """What is run."""
    out: Path = Path("runs/arm")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    json: Json = False

    def __call__(self) -> int:
        """Run."""
        from experiments.runs.run import run

        otherwise = _DEFAULTS if not self.options.replay else {name: _DEFAULTS[name] for name in ("map", "seconds")}
        config = config_of_options(self.options, otherwise)
        if config.body != "robot":
            raise ParameterError(f"the map {config.map.kind} moves a figure; expected --map robot-arm, or hvf run")
        say(run(config, self.out, self.overwrite, STARTED), self.json)
        return 0
