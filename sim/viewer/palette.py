"""Colours and their meaning, common to replay, report and figures; and the threshold of a push."""

import colorsys
from collections.abc import Sequence
from itertools import product

import numpy as np

from geometry.arrays import Array

FIELD = "#22a046"  # the field and what it leads
USER = "#eb7814"  # the hand's own force, and the path where it pushes
CURVE = "#3c465a"
TUBE = "#4682c8"
RIVERS = (TUBE, "#b5417a", "#8a6d1d", "#7a5fc0", "#1f8f98", "#a8453a", "#6b7280")  # of the first seven rivers

MIN_PUSH_FORCE = 0.2  # [N] force of the hand above which it counts as pushing


def rgb(color: str) -> tuple[int, int, int]:
    """``#rrggbb`` as three numbers from 0 to 255."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue


def river_colors(n: int) -> tuple[str, ...]:
    """Colours of n rivers: `RIVERS`, then colours perceptually farthest from these and from the other colours here."""
    colors: list[str] = list(RIVERS)
    candidates, coordinates = _candidates()
    nearest = np.min(
        [np.linalg.norm(coordinates - other, axis=1) for other in _oklab([*RIVERS, FIELD, USER, CURVE])], axis=0
    )
    while len(colors) < n:
        best = int(nearest.argmax())
        colors.append(candidates[best])
        nearest = np.minimum(nearest, np.linalg.norm(coordinates - coordinates[best], axis=1))
    return tuple(colors[:n])


def _candidates() -> tuple[list[str], Array]:
    """Colours with good contrast on white that are not glaring, and their coordinates in OKLab."""
    grid = product(np.arange(36) / 36.0, (0.3, 0.4, 0.5, 0.6), (0.35, 0.5, 0.65))
    shares = np.array([colorsys.hls_to_rgb(*hls) for hls in grid])
    colors = ["#" + bytes(row).hex() for row in np.rint(255.0 * shares).astype(np.uint8)]
    coordinates = _oklab(colors)
    is_usable = (coordinates[:, 0] > 0.35) & (coordinates[:, 0] < 0.7)
    return [color for color, keep in zip(colors, is_usable, strict=True) if keep], coordinates[is_usable]


def _oklab(colors: Sequence[str]) -> Array:
    """Colours as points (n, 3) of a perceptually uniform space (Ottosson 2020, "OKLab")."""
    share = np.array([rgb(color) for color in colors]) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.cbrt(linear @ _CONES) @ _LAB


_CONES = np.array(
    [
        [0.4122214708, 0.2119034982, 0.0883024619],
        [0.5363325363, 0.6806995451, 0.2817188376],
        [0.0514459929, 0.1073969566, 0.6299787005],
    ]
)
_LAB = np.array(
    [
        [0.2104542553, 1.9779984951, 0.0259040371],
        [0.7936177850, -2.4285922050, 0.7827717662],
        [-0.0040720468, 0.4505937099, -0.8086757660],
    ]
)
