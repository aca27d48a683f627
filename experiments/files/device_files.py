"""Device files: what `hvf hardware identify` found of a device, for simulation, certificates and hardware runs."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from experiments.config.run_config import Phantom
from experiments.files.json_text import json_text
from sim.errors import SimError
from sim.hardware.identification import NAMES, Identified
from sim.world.linkage import Linkage

_TRIPLES = ("coulomb", "viscous", "inertia")
_FORMAT = "hvf-device-1"


def device_json(found: Identified, recordings: Sequence[str]) -> dict[str, object]:
    """A device file's content: each quantity with its value and the half of its interval, in SI units."""
    values, margins = (dict(zip(NAMES, numbers.tolist(), strict=True)) for numbers in (found.values, found.margins))

    def entry(names: Sequence[str]) -> dict[str, object]:
        return {"value": [values[name] for name in names], "margin": [margins[name] for name in names]}

    return {
        "format": _FORMAT,
        **{quantity: entry([f"{quantity}{i}" for i in (1, 2, 3)]) for quantity in _TRIPLES},
        "delay": entry(["delay"]), "offset": entry(["offset2", "offset3"]), "weight": entry(["weight2", "weight3"]),
        "windows": found.windows, "unexplained": found.unexplained, "recordings": list(recordings),
    }  # fmt: skip


def save_device(content: Mapping[str, object], path: Path) -> None:
    """Write a device file."""
    path.write_text(json_text(content) + "\n", encoding="utf-8")


def load_device(path: Path) -> Linkage:
    """What a device file says the linkage is; what cannot be, such as a friction below zero, is taken as zero.

    Raises
    ------
    SimError
        If the file cannot be read, or is no device file.
    """
    try:
        content = cast(dict[str, dict[str, list[float]]], json.loads(path.read_text(encoding="utf-8")))
        if content["format"] != _FORMAT:  # pyright: ignore[reportUnnecessaryComparison]
            raise KeyError(f"format {content['format']!r}")
        coulomb, viscous, inertia = ([float(x) for x in content[name]["value"]] for name in _TRIPLES)
        second, third = (float(x) for x in content["offset"]["value"])
        delay = max(0.0, float(content["delay"]["value"][0]))
    except OSError as error:
        raise SimError(f"{path}: cannot be read ({error.strerror}); expected a device file") from None
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise SimError(f"{path}: no device file ({error}); expected what hvf hardware identify writes") from None
    a, b, c = (max(0.0, x) for x in coulomb)
    u, v, w = (max(0.0, x) for x in viscous)
    i, j, k = inertia
    return Linkage((a, b, c), (u, v, w), (i, j, k), delay, (0.0, second, third))


def linkage_of(device: Phantom) -> Linkage:
    """The linkage of a run's device: its file's, or the published one.

    Raises
    ------
    SimError
        As `load_device`.
    """
    return load_device(Path(device.device_file)) if device.device_file else Linkage()
