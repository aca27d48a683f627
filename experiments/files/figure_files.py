"""Plots as bytes and files; characters that their font lacks are taken from another one."""

import io
import re
import warnings
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager, get_font
from matplotlib.text import Text
from rich.console import Console

from geometry.whole_files import atomic_file


def save_figure(figure: Figure, path: Path, **options: Any) -> None:
    """Write a plot in the format of the file's suffix, with options of `Figure.savefig`; raises as `atomic_file`."""
    content = drawn(figure, path.suffix[1:], **options)
    with atomic_file(path) as file:
        file.write(content)


def drawn(figure: Figure, kind: str, **options: Any) -> bytes:
    """A plot in a format such as "png", with options of `Figure.savefig`.

    Characters that its font lacks are drawn in an installed font that has them; those that none has are named on
    stderr.
    """
    content, missing = _draw(figure, kind, options)
    if missing:
        families = _families_with(missing)
        for text in figure.findobj(Text):
            text.set_fontfamily([*text.get_fontfamily(), *families])
        content, missing = _draw(figure, kind, options)
    if missing:
        Console(stderr=True).print(
            f"No installed font has {' '.join(sorted(missing))}, which a plot shows as boxes.", highlight=False
        )
    return content


def _draw(figure: Figure, kind: str, options: dict[str, Any]) -> tuple[bytes, set[str]]:
    """The plot, and the characters that its fonts lack."""
    content, missing = io.BytesIO(), set[str]()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        figure.savefig(content, format=kind, **options)
    for warning in caught:
        if glyph := re.match(r"Glyph (\d+) .* missing from", str(warning.message)):
            missing.add(chr(int(glyph[1])))
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return content.getvalue(), missing


def _families_with(characters: set[str]) -> list[str]:
    """Installed font families, as few as have those of the characters that any has."""
    families, left = list[str](), {ord(character) for character in characters}
    for font in fontManager.ttflist:
        is_placeholder = font.name.startswith("Last Resort")  # has a box for every character
        if not is_placeholder and (found := left & get_font(font.fname).get_charmap().keys()):
            families.append(font.name)
            left -= found
        if not left:
            break
    return families
