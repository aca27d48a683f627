"""Common layout of all generated pages: one self-contained HTML document, readable on a phone."""

import base64
import html
import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from experiments.files.figure_files import drawn

NUMBERS = """
table { font-size: .8rem; }
th, td { padding: .25rem .55rem .25rem 0; text-align: right; white-space: nowrap; }
th:first-child, td:first-child, .l { text-align: left; }
td.says { white-space: normal; text-align: left; }
tr.weak { color: #7b8698; }
"""
"""Style of pages with tables of numbers."""
_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222a38; margin: 0 auto; max-width: 1180px; padding: 1.5rem; }
h1 { font-size: 1.5rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
p, li { overflow-wrap: anywhere; }
img { max-width: 100%; }
iframe { width: 100%; height: min(42rem, 80vh); box-sizing: border-box; border: 1px solid #d9dde4; border-radius: 6px; }
.found { font-size: 1.05rem; border-left: 4px solid #1f5fbf; padding-left: 1rem; }
.found p { margin: .4rem 0; }
.note { font-size: .9rem; color: #566072; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #e4e8ee; }
pre { background: #f5f7fa; padding: 1rem; overflow-x: auto; font-size: .85rem; border-radius: 6px; }
@media (max-width: 600px) { body { padding: .8rem; } iframe { height: 70vh; } }
"""


def html_page(title: str, body: str, style: str = "") -> str:
    """HTML of a whole page.

    Parameters
    ----------
    title : str
        Title and heading of the page.
    body : str
        HTML below the heading. A table or a picture wider than a phone belongs in a ``div`` of class ``wide``, which
        scrolls.
    style : str
        Additional CSS of this page.
    """
    name = html.escape(title)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<title>{name}</title>\n<style>{_STYLE}{style}</style>\n</head>\n<body>\n<h1>{name}</h1>\n{body}\n</body>\n</html>\n"
    )


def image(picture: Figure | Path, name: str) -> str:
    """HTML of a plot or a PNG file, embedded in the page."""
    data = picture.read_bytes() if isinstance(picture, Path) else drawn(picture, "png", dpi=110)
    return f'<img alt="{html.escape(name)}" src="data:image/png;base64,{base64.b64encode(data).decode()}">'


def sentences(said: Sequence[str]) -> str:
    """HTML of the main results, a paragraph each."""
    return f'<div class="found">{"".join(f"<p>{html.escape(one)}</p>" for one in said)}</div>\n'


def short(value: float) -> str:
    """Text of a number in a table, to three digits; a dash if it is not finite."""
    return f"{value:.3g}" if math.isfinite(value) else "–"
