"""``hvf lift``: a map from clips alone."""

from dataclasses import field
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from controllers.haptic_map.lifting.room import Room
from experiments.config.part import part, whole_number
from experiments.console.output import Json, say
from experiments.console.progress import working


@part
class Command:
    """Author a curve for every clip, and one haptic map with all of them, from the clips alone."""

    clips: Positional[tuple[str, ...]]
    """Names of embedded clips, or files."""
    out: Path = Path("runs/map.npz")
    """File to write the map into."""
    room: Room = field(default_factory=Room)
    """Where curves may be, and how near to each other and how fast."""
    cyclic: tuple[str, ...] = ()
    """Clips that must close; by default all that can."""
    seed: Annotated[int, whole_number(0)] = 1
    """Seed of the initial arrangement."""
    raw: bool = False
    """Take motion files as captured; by default they are prepared once, as by hvf prepare."""
    overwrite: bool = False
    """Replace the file if it exists."""
    json: Json = False

    def __call__(self) -> int:
        """Lift the clips, and report on the map."""
        from experiments.lifting.lift_report import lift_into

        with working("lifting", len(self.clips)):
            report = lift_into(
                self.clips, self.out, room=self.room, cyclic=self.cyclic, seed=self.seed, overwrite=self.overwrite,
                raw=self.raw,
            )  # fmt: skip
        say(report.to_json(), self.json, report.lines())
        return 0
