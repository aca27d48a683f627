"""Curves in files: samples as JSON, exact to the last digit."""

import json
from pathlib import Path

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError
from geometry.whole_files import write_text
from sim.errors import SimError

CURVE_FILE = "curve.json"


def save_curve(curve: Trajectory, path: Path) -> None:
    """Write a curve as JSON: times [s], positions in H [m], quaternions wxyz, periodic, ends."""
    samples = {name: np.asarray(getattr(curve, name)).tolist() for name in ("times", "positions", "quaternions")}
    write_text(path, json.dumps(samples | {"periodic": curve.periodic, "ends": curve.ends}) + "\n")


def load_curve(path: Path) -> Trajectory:
    """Read a curve that `save_curve` wrote.

    Raises
    ------
    SimError
        If it is not a file of a curve.
    CurveError
        If its samples do not define a curve.
    """
    keys = ("times", "positions", "quaternions", "periodic", "ends")
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        times, positions, quaternions, periodic, ends = (values[key] for key in keys)
        return Trajectory(times, positions, quaternions, bool(periodic), ends)
    except CurveError as error:
        raise CurveError(f"{path}: {error}") from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise SimError(f"{path}: not a curve ({error}); expected JSON with {', '.join(keys)}") from None
