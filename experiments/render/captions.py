"""Captions on the frames of a film: content, time, and forces of field and hand."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from PIL import Image as Pictures
from PIL import ImageDraw, ImageFont

from experiments.render.graphics import Image

INK = "#222a38"
_PLATE = 0.7  # opacity of the white plate under words
_SHARE = 0.028  # size of letters as a share of the picture's height


class Entry(NamedTuple):
    """A line of a legend: a dot in a colour, and words."""

    color: str
    text: str


class Captions:
    """Writes captions in a size that fits a picture.

    Parameters
    ----------
    height : int
        Height of the picture [pixels].
    """

    def __init__(self, height: int):
        folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
        self.size = max(9, round(_SHARE * height))
        self._plain = ImageFont.truetype(folder / "DejaVuSans.ttf", self.size)
        self._bold = ImageFont.truetype(folder / "DejaVuSans-Bold.ttf", self.size)

    def on(
        self, picture: Image, title: str, right: str = "", legend: Sequence[Entry] = (), at_foot: bool = False
    ) -> Image:
        """A picture with a title at the top left, words at the top right, a legend below the title or at the foot."""
        size, (height, width, _) = self.size, picture.shape
        line, side = 1.5 * size, round(0.5 * size)
        wide = 2.7 * size + max((self._plain.getlength(entry.text) for entry in legend), default=0.0)
        first = height - 0.8 * size - line * len(legend) if at_foot else 2.5 * size
        head = 1.0 * size + self._bold.getlength(title)
        below = (side, first - 0.3 * size, side + wide, first + line * len(legend))
        beside = (width - side - self._plain.getlength(right) - size, side, width - side, 2.2 * size)
        plates = [(side, side, side + head, 2.2 * size), *[below] * bool(legend), *[beside] * bool(right)]
        canvas = Pictures.fromarray(_paler(picture, plates))
        pen = ImageDraw.Draw(canvas)
        pen.text((size, 0.8 * size), title, font=self._bold, fill=INK)
        pen.text((width - size, 0.8 * size), right, font=self._plain, fill=INK, anchor="ra")
        for k, entry in enumerate(legend):
            y = first + line * k
            pen.ellipse((1.05 * size, y + 0.28 * size, 1.75 * size, y + 0.98 * size), fill=entry.color)
            pen.text((2.2 * size, y), entry.text, font=self._plain, fill=INK)
        return np.asarray(canvas)


def _paler(picture: Image, plates: Sequence[tuple[float, float, float, float]]) -> Image:
    """A copy with white laid over rectangles (left, top, right, bottom), so that words on them can be read."""
    paler = np.array(picture)
    for left, top, right, bottom in plates:
        part = paler[round(top) : round(bottom), round(left) : round(right)]
        part[:] = 255 - ((255 - part) * (1.0 - _PLATE)).astype(np.uint8)
    return paler


def halved(picture: Image) -> Image:
    """A picture of half the size."""
    height, width, _ = picture.shape
    small = Pictures.fromarray(np.ascontiguousarray(picture)).resize((width // 2, height // 2), Pictures.Resampling.BOX)
    return np.asarray(small)
