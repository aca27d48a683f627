"""Device files: what was found of a device, for simulation, certificates and hardware runs.

`hvf hardware calibrate` writes where its encoders' zero is, and of which device; `hvf hardware identify` its friction,
inertia, delay and weights. Each leaves to the file what the other found; what a file does not tell is as published.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from experiments.config.run_config import Phantom
from experiments.files.json_text import json_text
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError
from sim.hardware.identification import NAMES, Identified
from sim.world.linkage import Linkage, Triple

_TRIPLES = ("coulomb", "viscous", "inertia")
_FORMAT = "hvf-device-1"
_MOST = 1e3
"""More than any of the numbers can be: [N m], [N m s/rad], [kg m²], [s], [rad]."""


class Calibration(NamedTuple):
    """Whose encoders' zero a device file has.

    Attributes
    ----------
    name, serial : str
        Of the device.
    power_up : int
        See `sim.devices.driver.DeviceIdentity`.
    """

    name: str
    serial: str
    power_up: int

    def why_not(self, identity: DeviceIdentity) -> str:
        """Why it is not the zero of this device now; empty if it is."""
        if (self.name, self.serial) != (identity.name, identity.serial):
            return f"is calibrated for {self.name} {self.serial}".rstrip()
        if self.power_up != identity.power_up and not identity.calibrated:
            return "was calibrated before the device was switched off, and its encoders count from where they wake up"
        return ""


def identified_json(found: Identified, recordings: Sequence[str], base: Mapping[str, object]) -> dict[str, object]:
    """A device file's content with what was found: each quantity with its value and half of its interval, SI units.

    Parameters
    ----------
    found : Identified
        Its offsets are of readings from which those of `base` had been taken off.
    recordings : sequence of str
        What it was found in.
    base : mapping
        Content of the file that the recorded runs were made with; empty where there was none.
    """
    values, margins = (dict(zip(NAMES, numbers.tolist(), strict=True)) for numbers in (found.values, found.margins))

    def entry(names: Sequence[str]) -> dict[str, object]:
        return {"value": [values[name] for name in names], "margin": [margins[name] for name in names]}

    taken_off = linkage_from(base).offset
    first = cast(dict[str, list[float]], base.get("offset", {"margin": [None]}))["margin"][0]
    return {
        **base,
        "format": _FORMAT,
        **{quantity: entry([f"{quantity}{i}" for i in (1, 2, 3)]) for quantity in _TRIPLES},
        "delay": entry(["delay"]),
        "offset": {
            "value": [taken_off[0], taken_off[1] + values["offset2"], taken_off[2] + values["offset3"]],
            "margin": [first, margins["offset2"], margins["offset3"]],
        },
        "weight": entry(["weight2", "weight3"]),
        "windows": found.windows, "unexplained": found.unexplained, "recordings": list(recordings),
    }  # fmt: skip


def calibrated_json(
    offset: Sequence[float], margin: Sequence[float], identity: DeviceIdentity, base: Mapping[str, object]
) -> dict[str, object]:
    """A device file's content with the zero of its encoders [rad], shape (3,) each; all else is the `base`'s."""
    return {
        **base,
        "format": _FORMAT,
        "offset": {"value": list(offset), "margin": list(margin)},
        "calibration": Calibration(identity.name, identity.serial, identity.power_up)._asdict(),
    }


def save_device(content: Mapping[str, object], path: Path) -> None:
    """Write a device file."""
    path.write_text(json_text(content) + "\n", encoding="utf-8")


def read_device_file(path: Path) -> dict[str, Any]:
    """A device file's content.

    Raises
    ------
    SimError
        If the file cannot be read, or is no device file.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != _FORMAT:
            raise KeyError(f"format {content['format']!r}")
        linkage_from(content)
        calibration_from(content)
    except OSError as error:
        raise SimError(f"{path}: cannot be read ({error.strerror}); expected a device file") from None
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise SimError(
            f"{path}: no device file ({error}); expected what hvf hardware identify or calibrate writes"
        ) from None
    return cast(dict[str, Any], content)


def linkage_from(content: Mapping[str, Any]) -> Linkage:
    """What a content says the linkage is; a friction or delay that was found below zero is taken as zero.

    Raises
    ------
    SimError
        If a number cannot be, or a rotor has less inertia than none.
    """
    published = Linkage()

    def numbers(name: str, least: float) -> list[float]:
        found = [float(x) for x in content[name]["value"]]
        if not all(abs(x) < _MOST for x in found):  # which NaN is not
            raise SimError(f"{name} {found}")
        return [max(least, x) for x in found]

    def three(name: str, least: float, otherwise: Triple) -> Triple:
        if name not in content:
            return otherwise
        a, b, c = numbers(name, least)
        return a, b, c

    return Linkage(
        three("coulomb", 0.0, published.coulomb), three("viscous", 0.0, published.viscous),
        three("inertia", -float("inf"), published.inertia),
        numbers("delay", 0.0)[0] if "delay" in content else 0.0,
        three("offset", -float("inf"), published.offset),
    )  # fmt: skip


def calibration_from(content: Mapping[str, Any]) -> Calibration | None:
    """Whose zero a content has; None if it has none."""
    told = content.get("calibration")
    return Calibration(str(told["name"]), str(told["serial"]), int(told["power_up"])) if told else None


def content_of(device: Phantom) -> dict[str, Any]:
    """Content of a run's device file; empty where it has none.

    Raises
    ------
    SimError
        As `read_device_file`.
    """
    return read_device_file(Path(device.device_file)) if device.device_file else {}


def linkage_of(device: Phantom) -> Linkage:
    """The linkage of a run's device: its file's, or the published one.

    Raises
    ------
    SimError
        As `read_device_file`.
    """
    return linkage_from(content_of(device))
