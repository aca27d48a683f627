"""The folder of a run: its files, its lock, and the configuration, clips and world stored in its recording."""

import errno
import fcntl
import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import mujoco

from controllers.errors import ParameterError
from experiments.config.part import from_dict
from experiments.config.run_config import Phantom, Replay, RunConfig
from experiments.files.curve_files import CURVE_FILE
from experiments.files.made_folder import made_folder
from models.mocap.motion.clip import Clip
from models.world.scene import SceneConfig
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.world.world import BodyKind, World

RECORDING, SUMMARY, REPORT, CONFIG = "run.h5", "summary.json", "report.html", "config.json"
EDITED, DEFAULT, FIGURES, DEVICE = "edited.bvh", "default.bvh", "figures", "run-device.json"
FILM, GIF = "film.mp4", "film.gif"
_RUN_FILES = (RECORDING, SUMMARY, REPORT, CONFIG, EDITED, DEFAULT, CURVE_FILE, DEVICE)


def check_folder(out: Path, overwrite: bool) -> None:
    """Refuse a folder that cannot be written or created, is in use, or holds a run that may not be replaced."""
    with made_folder(out), locked_folder(out):
        check_holds(out, overwrite)


def check_holds(out: Path, overwrite: bool) -> None:
    """Refuse a folder that holds a run, or other files of the names that a run writes, unless they may be replaced."""
    if overwrite:
        return
    if (out / RECORDING).exists():
        raise SimError(f"{out}: holds a run; choose another --out, or --overwrite it")
    if taken := [name for name in (*_RUN_FILES, FIGURES) if (out / name).exists()]:
        raise SimError(f"{out}: holds {', '.join(taken)} without a run; choose another --out, or --overwrite them")


@contextmanager
def locked_folder(out: Path) -> Generator[None]:
    """Lock a folder, created if it is missing, for this process; the system releases the lock when the process ends.

    Raises
    ------
    SimError
        If it is a file, or another process holds it.
    """
    if out.exists() and not out.is_dir():
        raise SimError(f"{out}: is a file; expected a folder to write the run into")
    out.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(out, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SimError(f"{out}: another run is being written into it; expected another --out, or wait") from None
        except OSError as error:
            if error.errno not in (errno.EBADF, errno.ENOLCK, errno.EOPNOTSUPP):  # raised by file systems without locks
                raise
        yield
    finally:
        os.close(descriptor)


@contextmanager
def claimed_and_cleared(out: Path, overwrite: bool, device: Phantom | Replay) -> Generator[None]:
    """Lock a folder as `locked_folder` does, and clear it for a run; raises SimError if it must not be written into."""
    if isinstance(device, Replay) and Path(device.run).resolve() == out.resolve():
        raise SimError(f"{out}: is the run whose hand is replayed, which the new one refers to; choose another --out")
    with locked_folder(out):
        check_holds(out, overwrite)
        clear_folder(out)
        yield


def clear_folder(out: Path) -> None:
    """Create the folder, and remove the files of an earlier run and its film from it; other files stay."""
    out.mkdir(parents=True, exist_ok=True)
    holds_run = (out / RECORDING).exists()
    if holds_run:
        shutil.rmtree(out / FIGURES, ignore_errors=True)
    for name in (*_RUN_FILES, FILM, GIF) if holds_run else _RUN_FILES:
        (out / name).unlink(missing_ok=True)


def config_of(recording: Recording) -> RunConfig:
    """The configuration of a recording.

    Raises
    ------
    SimError
        If it is of a `Simulation` put together in Python, or recorded by an incompatible version of the program.
    """
    if "simulation" in recording.config:
        raise SimError(
            f"{recording.path}: is of a simulation put together in Python, whose parts a recording does not hold; "
            "expected the run of a configuration, or run the script again that made it"
        )
    try:
        return from_dict(RunConfig, recording.config, "the recording's configuration")
    except ParameterError as error:
        raise SimError(f"{error}; it was recorded by another version of the program, which can run it again") from None


def is_device_recording(recording: Recording) -> bool:
    """Whether a recording is of a device, whose figure is only shown beside it and not recorded."""
    return "clock" in recording.groups.get("ticks", {})


def has_animation(recording: Recording) -> bool:
    """Whether a recording holds the animation of a figure: a run without one has none, nor has a robot arm's."""
    return "reference" in recording.groups.get("frames", {}) and recording.texts.get("figure") != "robot"


def clips_of(recording: Recording) -> tuple[Clip, ...]:
    """The clips of a recording, as poses of the figure."""
    names = recording.texts["clip_names"].split("\n") if recording.texts["clip_names"] else []
    rates = recording.arrays["clip_fps"]
    return tuple(Clip(recording.arrays[f"clip_{i}"], float(rates[i]), name) for i, name in enumerate(names))


def world_of(recording: Recording) -> mujoco.MjModel:
    """The MuJoCo model to which the recorded qpos belongs: with the figure or the robot arm if there was one."""
    kind = cast(BodyKind, recording.texts["figure"])
    return World(scene_of(recording), kind).full_model()


def scene_of(recording: Recording) -> SceneConfig:
    """Configuration of the world of a recording: the figure's size and the rates."""
    stature, mass, servo_period, physics_step = (float(number) for number in recording.arrays["scene"])
    return SceneConfig(stature, mass, servo_period, physics_step)
