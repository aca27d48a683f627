"""``hvf hardware``: real devices from the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from experiments.config.options import config_of_options
from experiments.config.part import above, part
from experiments.console.output import Json, say
from experiments.hardware.run_options import EMULATED, RunHardware


@dataclass(frozen=True)
class ListDevices:
    """List every device that this machine sees, and how to open it; nothing is sent to them."""

    json: bool = False
    """Print them as JSON."""

    def __call__(self) -> int:
        """Name them."""
        from sim.devices.hardware_list import list_devices

        devices = list_devices()
        lines = [
            line for device in devices for line in (
                f"{device.name or '-':24} {device.where()}", f"{'':24} {device.maker_and_product()}: {device.note}"
            )
        ]  # fmt: skip
        say(devices, self.json, lines or ["no device found; `hvf hardware doctor` says what may be missing"])
        return 0


@part
class Doctor:
    """Report what is missing to drive a device from this machine, and measure the machine's lateness."""

    device: str | None = None
    """Also open this device, and measure its response times with its motors off; a name of `hvf hardware list`."""
    seconds: Annotated[float, above(0.0, unit="s", most=3600.0)] = 1.0
    """How long to measure, an hour at most [s]."""
    json: bool = False
    """Print the findings as JSON."""

    def __call__(self) -> int:
        """Measure, and print the findings."""
        from experiments.hardware.doctor import findings, measured_lateness
        from experiments.hardware.link import measured_link
        from sim.devices.hardware_list import list_devices, open_device

        devices = list_devices()
        checks, lateness = findings(devices), measured_lateness(self.seconds)
        link = identity = None
        if self.device is not None:
            driver = open_device(self.device)
            try:
                identity, link = driver.identity, measured_link(driver, self.seconds)
            finally:
                driver.close()
        lines = list[str]()
        for device in devices:
            lines += [f"device   {device.name or '-'}: {device.where()}"]
            lines += [f"{'':9}{device.maker_and_product()}: {device.note}"]
        lines += [line for finding in checks for line in finding.lines()]
        lines.append(
            f"timing   a loop of 1 kHz, {lateness.loops} times: late by {lateness.p50 * 1e6:.0f} µs (p50), "
            f"{lateness.p99 * 1e6:.0f} (p99), {lateness.p999 * 1e6:.0f} (p99.9), {lateness.worst * 1e6:.0f} at worst; "
            f"{lateness.missed} deadlines missed"
        )
        if identity is not None and link is not None:
            watchdog = "; no motors" if not identity.forces else "" if identity.watchdog else "; no watchdog"
            calibrated = "" if identity.calibrated else "; not calibrated"
            lines.append(f"link     {identity.name} {identity.serial} ({identity.transport}){watchdog}{calibrated}")
            lines += [f"{'':9}{line}" for line in link.lines()]
        found = {"devices": devices, "findings": checks, "lateness": lateness, "device": identity, "link": link}
        say(found, self.json, lines)
        return 0


@part
class RunDevice(RunHardware):
    """Run a field on a real device: its figure is shown, its twin mirrors it, everything is recorded."""

    def __call__(self) -> int:
        """Run."""
        from experiments.hardware.run import run_hardware

        return run_hardware(config_of_options(self.options), self)


@part
class CalibrateDevice:
    """Measure the encoders' zero while the stylus is at a known pose, and save it in a device file."""

    name: Annotated[str, tyro.conf.arg(name="device")] = EMULATED
    """A device as `hvf hardware list` names it, or "emulated"."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The joint angles θ1, θ2, θ3 at which the stylus is held, in a fixture or at its reset pose [rad]."""
    seconds: Annotated[float, above(0.0, unit="s", most=3600.0)] = 1.0
    """How long it is read, an hour at most [s]."""
    out: Path = Path("device.json")
    """Device file to write; friction, inertia and delay in an existing one are kept."""
    overwrite: bool = False
    """Replace the offset that the file has."""
    emulate: Path | None = None
    """Device file that the emulated device obeys."""
    json: Json = False
    """Print the file's content instead of a table."""

    def __call__(self) -> int:
        """Calibrate."""
        from experiments.hardware.calibrate import calibrate

        calibrate(self.name, self.pose, self.seconds, self.out, self.overwrite, self.emulate, self.json)
        return 0


@part
class IdentifyDevice:
    """Identify friction, inertia, delay and encoder offset of a device from recordings with no hand on the stylus."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of `hvf hardware run`, or their recordings; several fast and slow ones identify more than one."""
    out: Path = Path("device.json")
    """Device file to write."""
    overwrite: bool = False
    """Replace the file if it exists."""
    json: Json = False
    """Print the file's content instead of a table."""

    def __call__(self) -> int:
        """Identify."""
        from experiments.hardware.identify import identify

        identify(self.runs, self.out, self.overwrite, self.json)
        return 0


Which = (
    Annotated[ListDevices, tyro.conf.subcommand("list")]
    | Annotated[Doctor, tyro.conf.subcommand("doctor")]
    | Annotated[RunDevice, tyro.conf.subcommand("run")]
    | Annotated[CalibrateDevice, tyro.conf.subcommand("calibrate")]
    | Annotated[IdentifyDevice, tyro.conf.subcommand("identify")]
)  # fmt: skip


@dataclass(frozen=True)
class Command:
    """Real devices: list them, check this machine, run one, calibrate it and identify its parameters."""

    which: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Which]]

    def __call__(self) -> int:
        """Run the subcommand."""
        return self.which()
