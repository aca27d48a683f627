"""Runs the configuration of a recording again and compares the two bit for bit."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from llvmlite.binding import get_host_cpu_name

from controllers.state import Array
from experiments.config.maps import MapFile
from experiments.config.run_config import RunConfig
from experiments.files.map_files import map_digest
from experiments.results.folder import RECORDING, clips_of, config_of
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from sim.errors import SimError
from sim.loop.loop import Loop, groups, shown_channels, tick_channels
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recording import Recording


class _Comparison:
    """Compares the blocks of a run with a recording while it runs; keeps the first difference of each group."""

    def __init__(self, recording: Recording, session: Session):
        self._recording, self._root = recording, session.world.pose_at
        self._shown = groups(session.servo)["frames"].channels
        self._every = session.servo.figure_ticks
        self._rows = {"ticks": 0, "frames": 0}
        self.differences: dict[str, str] = {}

    def __call__(self, ticks: TickLog, frames: FrameLog, n: int) -> None:
        m = -(-n // self._every)
        self._compare("ticks", tick_channels(ticks, n), n)
        self._compare("frames", shown_channels(frames, m, self._shown, self._root), m)

    def _compare(self, group: str, blocks: Mapping[str, Array], n: int) -> None:
        first = self._rows[group]
        for name, block in blocks.items():
            recorded = self._recording.channel(group, name)[first : first + n]
            mine = block[: len(recorded)]
            same = np.equal(recorded, mine) | (np.isnan(recorded) & np.isnan(mine))
            if group not in self.differences and not np.all(same):
                row = int(np.argmin(np.all(same.reshape(len(same), -1), axis=1)))
                self.differences[group] = f"{name} differs first at {group[:-1]} {first + row}"
        self._rows[group] += n


def check_map(config: RunConfig, recording: Recording) -> None:
    """Refuse a map whose file has changed since the recording was made."""
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


@dataclass(frozen=True)
class Reproduced:
    """Result of running a recording again.

    Attributes
    ----------
    same : bool
        Whether every tick and frame is the same, bit for bit.
    ticks : int
        Number of ticks compared.
    differences : dict of str to str
        First difference of each group of channels, in words.
    remarks : tuple of str
        Packages and processor that differ from those of the recording.
    """

    same: bool
    ticks: int
    differences: dict[str, str]
    remarks: tuple[str, ...]

    def lines(self) -> list[str]:
        """Result in words."""
        found = f"the same, bit for bit, over {self.ticks} ticks and what the figure did"
        return [*self.remarks, found if self.same else f"not the same: {'; '.join(self.differences.values())}"]


def reproduce(folder: Path) -> Reproduced:
    """Run a recording's configuration again, and compare every tick and frame.

    Raises
    ------
    SimError
        If the folder holds no recording, the file of its map has changed, or a person drove the run live.
    OSError
        If a file cannot be read.
    """
    with Recording(folder / RECORDING) as recording:
        if "live" in recording.texts:
            raise SimError(f"{folder}: was {recording.texts['live']}; expected the run of a configuration")
        remarks, config = _others(recording.versions), config_of(recording)
        check_map(config, recording)
        session = wire(config, clips_of(recording))
        comparison = _Comparison(recording, session)
        recorded_ticks = len(recording.channel("ticks", "t"))
        Loop(session.servo, session.world, comparison).run(recorded_ticks * session.servo.plant.period)
    return Reproduced(not comparison.differences, recorded_ticks, comparison.differences, remarks)


def _others(versions: Mapping[str, str]) -> tuple[str, ...]:
    """Packages and processor that differ from those of a recording, in words."""
    said: list[str] = []
    for package, recorded in versions.items():
        if package == "processor":
            here = get_host_cpu_name()
            if here != recorded:
                said.append(
                    f"recorded on a processor {recorded}, this is {here}: libraries round otherwise, expect differences"
                )
        elif package != "python" and version(package) != recorded:
            said.append(f"recorded with {package} {recorded}, now {version(package)}: expect differences")
    return tuple(said)
