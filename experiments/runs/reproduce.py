"""Runs the configuration of a recording again and compares the two bit for bit."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from llvmlite.binding import get_host_cpu_name

from experiments.config.maps import MapFile
from experiments.config.run_config import RunConfig
from experiments.files.map_files import map_digest
from experiments.results.folder import RECORDING, clips_of, config_of, is_device_recording
from experiments.setups.parts.devices import check_hand
from experiments.setups.wiring import wire
from geometry.arrays import Array
from sim.errors import SimError
from sim.loop.channels import Channels, channels
from sim.loop.loop import Loop
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recording import Recording


class _Comparison:
    """Compares the blocks of a run with a recording while it runs; keeps the first difference of each group."""

    def __init__(self, recording: Recording, channels: Channels):
        self._recording, self._channels = recording, channels
        self._row_counts = {"ticks": 0, "frames": 0}
        self.differences: dict[str, str] = {}

    def __call__(self, ticks: TickLog, frames: FrameLog, n: int) -> None:
        for group, blocks in self._channels(ticks, frames, n).items():
            self._compare(group, blocks)

    def _compare(self, group: str, blocks: Mapping[str, Array]) -> None:
        first, n = self._row_counts[group], len(blocks["t"])
        for name, block in blocks.items():
            recorded = self._recording.channel(group, name)[first : first + n]
            computed = block[: len(recorded)]
            same = np.equal(recorded, computed) | (np.isnan(recorded) & np.isnan(computed))
            if group not in self.differences and not np.all(same):
                row = int(np.argmin(np.all(same.reshape(len(same), -1), axis=1)))
                self.differences[group] = f"{name} differs first at {group[:-1]} {first + row}"
        self._row_counts[group] += n


def check_files(config: RunConfig, recording: Recording) -> None:
    """Refuse a map whose file, or a replayed hand whose recording, has changed since the recording was made.

    Raises
    ------
    SimError
        If one has changed or the hand's recording cannot be read.
    OSError
        If the map's file cannot be read.
    """
    check_hand(config, recording)
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
        found = f"the same, bit for bit, over {self.ticks} ticks and all frames"
        return [*self.remarks, found if self.same else f"not the same: {'; '.join(self.differences.values())}"]


def reproduce(folder: Path) -> Reproduced:
    """Run a recording's configuration again, and compare every tick and frame.

    Raises
    ------
    SimError
        If the folder holds no recording or a damaged one, the file of its map or the hand that it replays has changed,
        a person drove the run live, or it is of a device or of a `Simulation` put together in Python.
    OSError
        If a file cannot be read.
    """
    with Recording(folder / RECORDING) as recording:
        if "live" in recording.texts:
            raise SimError(f"{folder}: was {recording.texts['live']}; expected the run of a configuration")
        if is_device_recording(recording):
            raise SimError(f"{folder}: is of a device, which moves differently each time; expected a simulated run")
        remarks = _environment_remarks(recording.versions)
        config = config_of(recording)
        check_files(config, recording)
        session = wire(config, clips_of(recording))
        servo, world = session.servo, session.world
        comparison = _Comparison(recording, channels(servo, world))
        recorded_ticks, recorded_frames = (len(recording.channel(group, "t")) for group in ("ticks", "frames"))
        frames = -(-recorded_ticks // servo.figure_ticks)
        if recorded_frames != frames:
            raise SimError(
                f"{recording.path}: damaged: it has {recorded_frames} frames; expected {frames} for {recorded_ticks} "
                "ticks"
            )
        Loop(servo, world, comparison).run(recorded_ticks * servo.plant.period)
    return Reproduced(not comparison.differences, recorded_ticks, comparison.differences, remarks)


def _environment_remarks(versions: Mapping[str, str]) -> tuple[str, ...]:
    """Packages and processor that differ from those of a recording, in words."""
    remarks: list[str] = []
    for package, recorded in versions.items():
        if package == "processor":
            here = get_host_cpu_name()
            if here != recorded:
                remarks.append(
                    f"recorded on a processor {recorded}, this is {here}: libraries round otherwise, expect differences"
                )
        elif package != "python" and version(package) != recorded:
            remarks.append(f"recorded with {package} {recorded}, now {version(package)}: expect differences")
    return tuple(remarks)
