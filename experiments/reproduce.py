"""Whether a recorded run happens again, bit for bit, from its recorded configuration."""

from importlib.metadata import version
from pathlib import Path

import numpy as np

from experiments.config.maps import MapFile
from experiments.config.run_config import RunConfig
from experiments.files.map_files import map_digest
from experiments.results.folder import RECORDING, clips_of, config_of
from experiments.setups.wiring import wire
from sim.errors import SimError
from sim.loop.loop import Loop, tick_channels
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recording import Recording


class _Comparison:
    """Compares the blocks of a run with a recording as they come; keeps the first difference."""

    def __init__(self, recording: Recording):
        self._recording = recording
        self.rows = 0
        self.difference: str | None = None

    def __call__(self, ticks: TickLog, frames: FrameLog, n: int) -> None:
        for name, block in tick_channels(ticks, n).items():
            recorded = self._recording.channel("ticks", name)[self.rows : self.rows + n]
            same = np.equal(recorded, block[: len(recorded)]) | (np.isnan(recorded) & np.isnan(block[: len(recorded)]))
            if self.difference is None and not np.all(same):
                row = int(np.argmin(np.all(same.reshape(len(same), -1), axis=1)))
                self.difference = f"{name} differs first at tick {self.rows + row}"
        self.rows += n


def _check_map(config: RunConfig, recording: Recording) -> None:
    """Refuse a map whose file is not the one that was recorded with."""
    recorded = recording.texts.get("map_sha256")
    if recorded is None:
        return
    path = config.map.file if isinstance(config.map, MapFile) else ""
    found = map_digest(Path(path))
    if found != recorded:
        raise SimError(
            f"{path}: the map has changed since the run was recorded: its SHA-256 is {found[:12]}…, expected "
            f"{recorded[:12]}…; put the file back that the run was made with, or make it again by the same hvf lift"
        )


def reproduce(folder: Path) -> int:
    """Run a recording's configuration again, say whether every tick is the same, and return an exit code.

    Raises
    ------
    SimError
        If it is no recording, or the file of its map has changed.
    OSError
        If a file cannot be read.
    """
    with Recording(folder / RECORDING) as recording:
        for package, recorded in recording.versions.items():
            if package != "python" and version(package) != recorded:
                print(f"recorded with {package} {recorded}, now {version(package)}: expect differences")
        config = config_of(recording)
        _check_map(config, recording)
        session = wire(config, clips_of(recording))
        comparison = _Comparison(recording)
        recorded_ticks = len(recording.channel("ticks", "t"))
        Loop(session.servo, session.world, comparison).run(recorded_ticks * session.servo.plant.period)
    if comparison.difference is not None:
        print(f"not the same: {comparison.difference}")
        return 1
    print(f"the same, bit for bit, over {recorded_ticks} ticks")
    return 0
