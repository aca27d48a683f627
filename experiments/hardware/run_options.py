"""Options of ``hvf hardware run``; few imports, so that ``hvf`` starts quickly."""

from pathlib import Path
from typing import Annotated

import tyro

from controllers.errors import ParameterError
from experiments.config.options import Options
from experiments.config.part import above, at_least, part
from experiments.console.output import Json

EMULATED = "emulated"


@part
class RunHardware:
    """How a field is run on a real device."""

    options: Options  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    """The field, as in `hvf run`."""
    name: Annotated[str, tyro.conf.arg(name="device")] = EMULATED
    """A device as `hvf hardware list` names it, or "emulated": the MuJoCo linkage in a process of its own."""
    emulate: Path | None = None
    """Device file that the emulated device obeys, hidden from the servo; by default that of --device-file."""
    certificate: Path | None = None
    """Folder or certificate.json of `hvf certify` for this very field; only the emulated device runs without."""
    delay: Annotated[float, at_least(0.0, unit="s")] = 0.0
    """Delay of the motors' torques, as it was certified [s]."""
    out: Path = Path("runs/hardware")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    arm: bool = False
    """Arm at once; otherwise a person at the terminal presses Enter."""
    dead_man: bool = True
    """Force only while the stylus's switch is held."""
    force: Annotated[float, above(0.0, unit="N")] = 4.0
    """Largest force [N]."""
    speed: Annotated[float, above(0.0, unit="m/s")] = 1.0
    """Speed of the tip from which on the force fades; half as much again is a fault [m/s]."""
    small: Annotated[float, above(0.0, unit="N")] = 1.0
    """No force before the requested one has been at most this small [N]."""
    ramp: Annotated[float, above(0.0, unit="s")] = 1.0
    """Time over which the force is ramped up [s]."""
    late: Annotated[float, above(0.0, unit="s", most=10.0)] = 0.04
    """Lateness of the servo that counts as a fault, at most 10 [s]."""
    silence: Annotated[float, at_least(2.0, unit="periods", most=5000.0)] = 5.0
    """Time without a new reading that counts as a fault; above 5, only with the emulated device [servo periods]."""
    realtime: bool = True
    """Run the servo with realtime priority."""
    view: bool = False
    """Show device and figure in a browser, from a process of its own."""
    json: Json = False
    """Print the outcome as JSON."""


def check_emulate(name: str, emulate: Path | None) -> None:
    """Refuse a device file for the emulated device if another device is used.

    Raises
    ------
    ParameterError
        If it is given.
    """
    if name != EMULATED and emulate is not None:
        raise ParameterError(
            f"--emulate {emulate} has no meaning with --device {name}; it belongs to --device {EMULATED}"
        )
