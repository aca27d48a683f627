"""``hvf prepare``: a motion file made a well-formed clip."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from experiments.console.output import Json, say
from experiments.console.progress import working


@dataclass(frozen=True)
class Command:
    """Make a well-formed clip from a capture: on the floor, looped or at rest, feasible by contact forces alone."""

    source: Annotated[Path, tyro.conf.Positional]
    """Motion file to read: BVH, AMC (with its ASF beside it) or DeepMimic."""
    target: Annotated[Path, tyro.conf.Positional]
    """BVH file to write."""
    loop: str = "auto"
    """How it continues: auto, open, lap (the part that repeats itself best), or START:END of the cycle, in seconds from
    the first frame that is kept."""
    mirror: bool = False
    """Continue with the mirror image of half a stride, or of START:END, as walks and runs do."""
    up: str | None = None
    """The file's up axis, such as +Y, if it cannot be inferred from the motion."""
    rest_frame: int | None = None
    """A frame in which the body stands upright with level feet, if none can be found."""
    roles: Path | None = None
    """TOML file that assigns joints to roles, such as left_thigh = "Bone.012", if their names are unknown."""
    frame_rate: float | None = None
    """Frames per second, where the file does not state them (AMC) or states them wrongly [Hz]."""
    report: Annotated[Path | None, tyro.conf.arg(aliases=["--out-report"])] = None
    """Folder for a page that shows what was done."""
    overwrite: bool = False
    """Replace the target if it exists."""
    json: Json = False

    def __call__(self) -> int:
        """Prepare the file, and report how well-formed the clip is."""
        from experiments.preparation.command import prepare_file
        from experiments.preparation.prepared_file import summary
        from models.mocap.retargeting.hints import Hints

        with working("preparing"):
            hints = Hints(self.up, self.rest_frame, self.roles, self.frame_rate)
            outcome = prepare_file(self.source, self.target, self.loop, self.mirror, hints, self.report, self.overwrite)
        output = {
            "well_formed": outcome.measures, "fidelity": outcome.prepared.fidelity, "followed": outcome.followed,
            "slide": outcome.slide, "faults": outcome.faults(), "doubts": outcome.doubts,
        }  # fmt: skip
        report = outcome.prepared.report
        lines = [*(report.notes() if report else ()), *summary(outcome)]
        say({"lines": lines, **output}, self.json)
        return 0
