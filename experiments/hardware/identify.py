"""``hvf hardware identify``: identifies friction, inertia, delay and offsets from recordings of a free device."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from controllers.safety.arming import State
from experiments.console.output import say
from experiments.files.device_files import identified_json, read_device_file, save_device
from experiments.results.folder import DEVICE, RECORDING, is_device_recording
from sim.errors import SimError
from sim.hardware.identification import NAMES, IdentificationResult, Motion, identify_linkage, motions_of
from sim.recording.recording import Recording

_SETTLING_TIME = 2.5
"""Time left out after activation [s], in which the hand that held the stylus lets go."""
_UNITS = {"coulomb": "N m", "viscous": "N m s/rad", "inertia": "kg m²", "delay": "s", "offset": "rad", "weight": "N m"}


def identify(runs: Sequence[Path], out: Path, overwrite: bool, as_json: bool) -> None:
    """Identify the parameters of a device, print them, and write its device file.

    The arguments are the options of ``hvf hardware identify``.

    Raises
    ------
    SimError
        If a recording is not of a hardware run or has too little motion, or the file exists.
    """
    if out.exists() and not overwrite:
        raise SimError(f"{out}: exists; choose another --out, or --overwrite it")
    if not runs:
        raise SimError("no recording is given; expected folders of hvf hardware run")
    base = device_of_runs(runs)
    motions = [motion for path in runs for motion in recorded_motions(path)]
    found = identify_linkage(motions)
    content = identified_json(found, [str(path) for path in runs], base)
    save_device(content, out)
    say(content, as_json, lines_of(found, motions))


def device_of_runs(runs: Sequence[Path]) -> dict[str, Any]:
    """Content of the device file with which all of these runs were made; empty if there was none.

    Raises
    ------
    SimError
        If the runs were made with different device files.
    """
    files = [(path if path.is_dir() else path.parent) / DEVICE for path in runs]
    contents = [read_device_file(file) if file.exists() else {} for file in files]
    for path, content in zip(runs, contents, strict=True):
        if content != contents[0]:
            raise SimError(f"{path}: was run with another device file than {runs[0]}; expected runs with the same one")
    return contents[0]


def recorded_motions(path: Path) -> list[Motion]:
    """Parts of a recording, or of the recording in a run's folder, in which the device was active and nobody held it.

    Raises
    ------
    SimError
        If it is not the recording of a hardware run.
    """
    file = path / RECORDING if path.is_dir() else path
    with Recording(file) as recording:
        if not is_device_recording(recording):
            raise SimError(f"{file}: is not a recording of a hardware run; expected one of hvf hardware run")
        tick, clock, theta, torque, state = (
            recording.channel("ticks", name)[:] for name in ("tick", "clock", "theta", "torque", "state")
        )
        rate = recording.rates["ticks"]
    active = state == State.ACTIVE
    settled = np.zeros(len(active), dtype=bool)
    settling_ticks = round(_SETTLING_TIME * rate)
    active_ticks = 0
    for k, on in enumerate(active):
        active_ticks = active_ticks + 1 if on else 0
        settled[k] = active_ticks > settling_ticks
    return motions_of(tick, clock, theta, torque, settled)


def lines_of(found: IdentificationResult, motions: Sequence[Motion]) -> list[str]:
    """IdentificationResult parameters in words, one per line."""
    seconds = sum(float(motion.clock[-1] - motion.clock[0]) for motion in motions)
    lines = [
        f"{seconds:.1f} s of motion, {found.windows} windows; {found.unexplained:.2%} of the torque is unexplained."
    ]
    for name, value, margin in zip(NAMES, found.values, found.margins, strict=True):
        unit = _UNITS[name.rstrip("123")]
        remark = "" if margin < abs(value) else "  (indistinguishable from zero)"
        lines.append(f"{name:9} {value: .4g} ± {margin:.2g} {unit}{remark}")
    return [*lines, "offset1    cannot be found from motions; hvf hardware calibrate measures it."]
