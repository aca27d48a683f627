"""A page that opens from disk: one file, nothing from elsewhere, and readable on a phone."""

import base64
import html
import io

from matplotlib.figure import Figure

WIDTH = 1180  # [px] of the text at most


def html_page(title: str, body: str, style: str = "", width: int = WIDTH) -> str:
    """A page with a heading.

    Parameters
    ----------
    title : str
        Plain text; the heading, too.
    body : str
        HTML. A table or a picture that is wider than a phone stands in a ``div`` of class ``wide``, which scrolls.
    style : str
        Further rules.
    width : int
        Of the text at most [px].
    """
    return _FRAME.format(title=html.escape(title), body=body, style=style, width=width)


def inline_png(png: bytes, alt: str) -> str:
    """A picture within the page."""
    return f'<img alt="{html.escape(alt)}" src="data:image/png;base64,{base64.b64encode(png).decode()}">'


def inline_figure(figure: Figure, alt: str = "plot") -> str:
    """A drawing within the page."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    return inline_png(picture.getvalue(), alt)


_FRAME = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #222a38; margin: 0 auto; max-width: {width}px; padding: 1.5rem; }}
h1 {{ font-size: 1.5rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }}
h2 {{ font-size: 1.1rem; margin: 2rem 0 .5rem; }}
p, li {{ overflow-wrap: anywhere; }}
p.note {{ font-size: .9rem; color: #566072; }}
.found {{ border-left: 4px solid #1f5fbf; padding-left: 1rem; }}
.found p {{ margin: .4rem 0; }}
.wide {{ overflow-x: auto; }}
table {{ border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }}
th, td {{ padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #e4e8ee; }}
img {{ max-width: 100%; }}
iframe {{ width: 100%; height: min(42rem, 80vh); box-sizing: border-box; border: 1px solid #d9dde4; }}
pre {{ background: #f5f7fa; padding: 1rem; overflow-x: auto; font-size: .85rem; border-radius: 6px; }}
@media (max-width: 600px) {{ body {{ padding: .8rem; }} iframe {{ height: 70vh; }} }}
{style}
</style>
</head>
<body>
<h1>{title}</h1>
{body}
</body>
</html>
"""
