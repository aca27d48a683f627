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
_PLATE_OPACITY = 0.7  # of the white plate under text
_FONT_SIZE_FRACTION = 0.028  # font size over the picture's height


class Entry(NamedTuple):
    """A line of a legend: a dot in a colour, and text."""

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
        self.size = max(9, round(_FONT_SIZE_FRACTION * height))
        self._plain = ImageFont.truetype(folder / "DejaVuSans.ttf", self.size)
        self._bold = ImageFont.truetype(folder / "DejaVuSans-Bold.ttf", self.size)

    def on(
        self, picture: Image, title: str, right: str = "", legend: Sequence[Entry] = (), at_foot: bool = False
    ) -> Image:
        """A picture with a title at the top left, text at the top right, a legend below the title or at the bottom."""
        size, (height, width, _) = self.size, picture.shape
        line_height, margin = 1.5 * size, round(0.5 * size)
        legend_width = 2.7 * size + max((self._plain.getlength(entry.text) for entry in legend), default=0.0)
        legend_top = height - 0.8 * size - line_height * len(legend) if at_foot else 2.5 * size
        title_end = 1.0 * size + self._bold.getlength(title)
        plate = (margin, legend_top - 0.3 * size, margin + legend_width, legend_top + line_height * len(legend))
        side_plate = (width - margin - self._plain.getlength(right) - size, margin, width - margin, 2.2 * size)
        plates = [
            (margin, margin, margin + title_end, 2.2 * size),
            *[plate] * bool(legend),
            *[side_plate] * bool(right),
        ]
        canvas = Pictures.fromarray(_lighten(picture, plates))
        pen = ImageDraw.Draw(canvas)
        pen.text((size, 0.8 * size), title, font=self._bold, fill=INK)
        pen.text((width - size, 0.8 * size), right, font=self._plain, fill=INK, anchor="ra")
        for k, entry in enumerate(legend):
            y = legend_top + line_height * k
            pen.ellipse((1.05 * size, y + 0.28 * size, 1.75 * size, y + 0.98 * size), fill=entry.color)
            pen.text((2.2 * size, y), entry.text, font=self._plain, fill=INK)
        return np.asarray(canvas)


def _lighten(picture: Image, plates: Sequence[tuple[float, float, float, float]]) -> Image:
    """A copy with white laid over rectangles (left, top, right, bottom), so that text on them is legible."""
    lightened = np.array(picture)
    for left, top, right, bottom in plates:
        part = lightened[round(top) : round(bottom), round(left) : round(right)]
        part[:] = 255 - ((255 - part) * (1.0 - _PLATE_OPACITY)).astype(np.uint8)
    return lightened


def halved(picture: Image) -> Image:
    """A picture of half the size."""
    height, width, _ = picture.shape
    small = Pictures.fromarray(np.ascontiguousarray(picture)).resize((width // 2, height // 2), Pictures.Resampling.BOX)
    return np.asarray(small)
