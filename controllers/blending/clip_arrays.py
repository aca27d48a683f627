"""Clips and limbs of a map as plain arrays for storage, restored bit for bit."""

from collections.abc import Mapping, Sequence

import numpy as np

from controllers.errors import ParameterError
from controllers.legs.limbs import Limb
from geometry.arrays import Array


def clip_arrays(
    clips: Sequence[tuple[Array, float]], names: Sequence[str | int], limbs: Sequence[Limb]
) -> dict[str, Array]:
    """Arrays by key: ``clip/name/poses`` and ``clip/name/fps``, ``limb/k/what``.

    Parameters
    ----------
    clips : sequence of (Array, float)
        Poses (n, nq) and frames per second.
    names : sequence of str or int
        Names or numbers of the clips, all different.
    limbs : sequence of Limb
    """
    arrays: dict[str, Array] = {}
    for name, (poses, fps) in zip(names, clips, strict=True):
        arrays |= {f"clip/{name}/poses": np.array(poses, dtype=np.float64), f"clip/{name}/fps": np.array([fps])}
    for k, limb in enumerate(limbs):
        numbers = {"joints": limb.joints, "offsets": limb.offsets, "axis": limb.axis, "points": limb.points}
        numbers["limits"] = limb.limits
        arrays |= {f"limb/{k}/{what}": np.array(value, dtype=np.float64) for what, value in numbers.items()}
    return arrays


def stored_array(arrays: Mapping[str, Array], key: str, shape: tuple[int | None, ...]) -> Array:
    """Stored array of a key, as floats of a given shape, in which None stands for any length.

    Raises
    ------
    ParameterError
        If the array is missing, does not hold numbers or has another shape.
    """
    if key not in arrays:
        raise ParameterError(f"the map lacks {key!r}")
    try:
        array = np.array(arrays[key], dtype=np.float64)
    except ValueError:
        raise ParameterError(f"{key!r} of the map does not hold numbers") from None
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        raise ParameterError(f"{key!r} of the map has shape {array.shape}, expected {shape}")
    return array


def stored_names(arrays: Mapping[str, Array]) -> tuple[str, ...]:
    """Names of the clips, in their order."""
    return tuple(dict.fromkeys(key[5:].rpartition("/")[0] for key in arrays if key.startswith("clip/")))


def stored_clips(arrays: Mapping[str, Array]) -> list[tuple[Array, float]]:
    """Clips restored from the output of `clip_arrays`.

    Raises
    ------
    ParameterError
        If an array is missing or has another shape.
    """
    return [
        (
            stored_array(arrays, f"clip/{name}/poses", (None, None)),
            float(stored_array(arrays, f"clip/{name}/fps", (1,))[0]),
        )
        for name in stored_names(arrays)
    ]


def stored_limbs(arrays: Mapping[str, Array]) -> list[Limb]:
    """Limbs restored from the output of `clip_arrays`; raises as `stored_clips` and `Limb` do."""
    limbs: list[Limb] = []
    while any(key.startswith(f"limb/{len(limbs)}/") for key in arrays):
        key = f"limb/{len(limbs)}/"
        joints = stored_array(arrays, f"{key}joints", (3,))
        if not np.isfinite(joints).all():
            raise ParameterError(f"'{key}joints' of the map must be finite, got {joints}")
        first, second, last = (int(joint) for joint in joints)
        offsets, axis = stored_array(arrays, f"{key}offsets", (3, 3)), stored_array(arrays, f"{key}axis", (3,))
        points = stored_array(arrays, f"{key}points", (None, 3))
        limits = stored_array(arrays, f"{key}limits", (3, 3, 2))
        limbs.append(Limb((first, second, last), offsets, axis, points, limits))
    return limbs
