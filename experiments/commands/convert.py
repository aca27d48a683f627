"""``hvf convert``: any motion file as the figure's own BVH, or as glTF."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from experiments.console.output import Json, say


@dataclass(frozen=True)
class Command:
    """Convert a BVH, AMC or DeepMimic motion to the figure's own BVH, or to glTF."""

    source: Positional[Path]
    """Motion file to read."""
    target: Positional[Path]
    """File to write: .bvh, or .glb for glTF."""
    up: str | None = None
    """The file's up axis, such as +Y, if it cannot be inferred from the motion."""
    rest_frame: int | None = None
    """A frame in which the body stands upright with level feet, if none can be found."""
    roles: Path | None = None
    """TOML file that assigns joints to roles, such as left_thigh = "Bone.012", if their names are unknown."""
    frame_rate: float | None = None
    """Frames per second, where the file does not state them (AMC) or states them wrongly [Hz]."""
    overwrite: bool = False
    """Replace the target if it exists."""
    json: Json = False

    def __call__(self) -> int:
        """Convert the file, and report how it was read."""
        from experiments.export.gltf import write_gltf
        from models.mocap.library import convert
        from models.mocap.readers.formats import BVH, GLTF
        from models.mocap.readers.own_bvh import write_bvh
        from models.mocap.retargeting.hints import Hints

        hints = Hints(self.up, self.rest_frame, self.roles, self.frame_rate)
        writers = {BVH.suffix: write_bvh, GLTF.suffix: write_gltf}
        report = convert(self.source, self.target, self.overwrite, hints, writers).report
        own = "the figure's own skeleton: nothing to retarget"
        say(report or {"lines": [own]}, self.json, report.lines() if report else (own,))
        return 0
