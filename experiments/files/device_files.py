"""Device files: calibration and identified parameters of a device, for simulation, certificates and hardware runs.

`hvf hardware calibrate` writes the zero of the encoders and the device to which it belongs; `hvf hardware identify`
writes friction, inertia, delay and weights. Each keeps what the other wrote; parameters that a file lacks have their
published values.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from experiments.config.run_config import Phantom, Replay, phantom_of
from experiments.files.json_text import json_text
from geometry.vectors import Triple
from geometry.whole_files import atomic_file
from models.phantom.parameters import PREMIUM_1_5
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError
from sim.hardware.identification import NAMES, IdentificationResult
from sim.world.linkage import Linkage

_JOINT_QUANTITIES = ("coulomb", "viscous", "inertia")
_FORMAT_NAME = "hvf-device-1"
_VALUE_COUNTS = dict.fromkeys((*_JOINT_QUANTITIES, "offset"), 3) | {"delay": 1, "weight": 2}
_KNOWN_KEYS = ("format", *_VALUE_COUNTS, "calibration", "windows", "unexplained", "recordings")
_MAX_PARAMETER = 1e3
"""Bound that no parameter can reach, in any of the units [N m], [N m s/rad], [kg m²], [s], [rad]."""
_MAX_TORQUE = max(PREMIUM_1_5.peak_torque)
"""Bound of friction and weight [N m]: the motors cannot overcome more."""


class Calibration(NamedTuple):
    """Name, serial number and `power_up` of the device to which the encoder zero of a device file belongs."""

    name: str
    serial: str
    power_up: int

    def rejection_reason(self, identity: DeviceIdentity) -> str:
        """Why the calibration is not valid for this device now; empty if it is."""
        if (self.name, self.serial) != (identity.name, identity.serial):
            return f"is calibrated for {self.name} {self.serial}".rstrip()
        if self.power_up != identity.power_up and not identity.calibrated:
            return "was calibrated before the device was switched off, and its encoders count from where they power up"
        return ""


def identified_json(
    found: IdentificationResult, recordings: Sequence[str], base: Mapping[str, object]
) -> dict[str, object]:
    """Content of a device file with identified parameters: value and half interval of each quantity, in SI units.

    Parameters
    ----------
    found : IdentificationResult
        Identified parameters; the offsets are relative to those of `base`, which the readings had already subtracted.
    recordings : sequence of str
        Recordings from which they were identified.
    base : mapping
        Content of the device file with which the recorded runs were made; empty if there was none.
    """
    values, margins = (dict(zip(NAMES, numbers.tolist(), strict=True)) for numbers in (found.values, found.margins))

    def entry(names: Sequence[str]) -> dict[str, object]:
        return {"value": [values[name] for name in names], "margin": [margins[name] for name in names]}

    subtracted = linkage_from(base).offset
    first = cast(dict[str, list[float | None]], base.get("offset", {})).get("margin", [None])[0]
    return {
        **base,
        "format": _FORMAT_NAME,
        **{quantity: entry([f"{quantity}{i}" for i in (1, 2, 3)]) for quantity in _JOINT_QUANTITIES},
        "delay": entry(["delay"]),
        "offset": {
            "value": [subtracted[0], subtracted[1] + values["offset2"], subtracted[2] + values["offset3"]],
            "margin": [first, margins["offset2"], margins["offset3"]],
        },
        "weight": entry(["weight2", "weight3"]),
        "windows": found.windows, "unexplained": found.unexplained, "recordings": list(recordings),
    }  # fmt: skip


def calibrated_json(
    offset: Sequence[float], margin: Sequence[float], identity: DeviceIdentity, base: Mapping[str, object]
) -> dict[str, object]:
    """Content of a device file with encoder offsets and their margins [rad], shape (3,) each; the rest is `base`."""
    return {
        **base,
        "format": _FORMAT_NAME,
        "offset": {"value": list(offset), "margin": list(margin)},
        "calibration": Calibration(identity.name, identity.serial, identity.power_up)._asdict(),
    }


def save_device(content: Mapping[str, object], path: Path) -> None:
    """Write a device file; an existing one is replaced, once all is written."""
    with atomic_file(path) as file:
        file.write(f"{json_text(content)}\n".encode())


def read_device_file(path: Path) -> dict[str, Any]:
    """Content of a device file.

    Raises
    ------
    SimError
        If the file cannot be read, or is not a device file.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
        if content["format"] != _FORMAT_NAME:
            raise KeyError(f"format {content['format']!r}")
        _check_content(content)
        linkage_from(content)
        calibration_from(content)
    except OSError as error:
        raise SimError(f"{path}: cannot be read ({error.strerror}); expected a device file") from None
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        raise SimError(
            f"{path}: not a device file ({error}); expected what hvf hardware identify or calibrate writes"
        ) from None
    return cast(dict[str, Any], content)


def _check_content(content: Mapping[str, Any]) -> None:
    """Refuse unknown keys, and numbers that no device can have."""
    _check_keys(content, _KNOWN_KEYS, "")
    _check_keys(content.get("calibration", {}), Calibration._fields, "calibration.")
    for name, length in _VALUE_COUNTS.items():
        entry = content.get(name, {})
        _check_keys(entry, ("value", "margin"), f"{name}.")
        bound = _MAX_TORQUE if name in ("coulomb", "weight") else _MAX_PARAMETER
        for which, least, most in (("value", -bound, bound), ("margin", 0.0, float("inf"))):
            numbers = entry.get(which, [None] * length)
            if len(numbers) != length:
                raise ValueError(f"{name}.{which} has {len(numbers)} numbers, not {length}")
            for number in numbers:
                if number is not None and (isinstance(number, bool) or not least <= number <= most):  # also NaN
                    raise ValueError(f"{name}.{which} {number} is not from {least:.3g} to {most:.3g}")


def _check_keys(given: Mapping[str, Any], known: Sequence[str], within: str) -> None:
    for name in given:
        if name not in known:
            raise ValueError(f"{within}{name} is not known, only {', '.join(known)}")


def linkage_from(content: Mapping[str, Any]) -> Linkage:
    """Linkage parameters from the content of a device file; a negative friction or delay is taken as zero.

    Raises
    ------
    SimError
        If a parameter is impossible, such as a rotor of negative inertia.
    """
    published = Linkage()

    def numbers(name: str, least: float) -> list[float]:
        return [max(least, float(x)) for x in content[name]["value"]]

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
    """Calibration in the content of a device file; None if it has none."""
    found = content.get("calibration")
    return Calibration(str(found["name"]), str(found["serial"]), int(found["power_up"])) if found else None


def content_of(device: Phantom | Replay) -> dict[str, Any]:
    """Content of a run's device file; empty if the run has none.

    Raises
    ------
    ParameterError
        If the device is a replayed hand.
    SimError
        As `read_device_file`.
    """
    file = phantom_of(device).device_file
    return read_device_file(Path(file)) if file else {}


def linkage_of(device: Phantom | Replay) -> Linkage:
    """Linkage of a run's device: that of its device file, or the published one.

    Raises
    ------
    ParameterError, SimError
        As `content_of`.
    """
    return linkage_from(content_of(device))
