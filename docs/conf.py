"""Sphinx: the pages of this folder and a reference made of the docstrings, readable without a network."""

import re
from importlib.metadata import version as installed

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

import hvf

project = "Haptic vector fields"
author = "The authors of haptic-vector-fields"
release = version = installed("haptic-vector-fields")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
default_role = "py:obj"
suppress_warnings = [
    "ref.python"  # `River` in a docstring may be one of three
]

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "pydata_sphinx_theme"
html_title = project
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"show_prev_next": True, "navigation_depth": 3, "footer_start": [], "footer_end": []}
html_sidebars = {"index": []}
html_show_sourcelink = False
html_math_renderer = "mathml"


_ACCENT = re.compile(r'<mover accent="true">\s*<mi>(.)</mi>\s*<mo stretchy="false">([˙¨ˆ~ˉ])</mo>\s*</mover>')
_COMBINING = {"˙": "\u0307", "¨": "\u0308", "ˆ": "\u0302", "~": "\u0303", "ˉ": "\u0304"}


def _combined(accent: re.Match[str]) -> str:
    """One letter with its accent: without a font for mathematics a browser puts the dot into the letter."""
    return f'<mi class="accented">{accent[1]}{_COMBINING[accent[2]]}</mi>'


def _mathml(self: HTML5Translator, node: nodes.Node, block: bool) -> None:
    tex = node.astext().replace(r"\|", r"\Vert ").replace(r"\textstyle", "")
    try:
        self.body.append(_ACCENT.sub(_combined, tex2mathml(tex, as_block=block)))
    except MathError as error:
        logging.getLogger(__name__).warning("%r: %s", tex, error, location=node)
    raise nodes.SkipNode


def _inline(self: HTML5Translator, node: nodes.math) -> None:
    _mathml(self, node, block=False)


def _display(self: HTML5Translator, node: nodes.math_block) -> None:
    _mathml(self, node, block=True)


_LITERAL = re.compile(r"(``.*?``|:math:`.*?`)")
_MARKUP = re.compile(r"\||(?<=\w)_(?=[\s*.,;:)']|$)|(?<=_)\*|(?<!\w)\*+(?=\w+\b(?!\*))")


def _plain_bars(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Take |v| and h_* in docstrings as the magnitude and the derivative that they are, not as markup."""
    in_math, indent = False, 0
    for i, line in enumerate(lines):
        depth = len(line) - len(line.lstrip())
        if line.strip() and in_math and depth <= indent:
            in_math = False
        if line.lstrip().startswith(".. math::"):
            in_math, indent = True, depth
        if not in_math:  # |v|, h_* and **words as they are
            parts = _LITERAL.split(line)
            parts[::2] = [_MARKUP.sub(r"\\\g<0>", part) for part in parts[::2]]
            lines[i] = "".join(parts)


def _skipped(app: Sphinx, what: str, name: str, obj: object, skip: bool, options: object) -> bool | None:
    """Leave out what `hvf` exports, which is on its own page, and fields of tuples, which their class describes."""
    exported = what == "module" and getattr(hvf, name, None) is obj
    elsewhere = exported and app.env.current_document.docname != "reference/python"
    return True if elsewhere or type(obj).__name__ == "_tuplegetter" else None


def setup(app: Sphinx) -> None:
    """Mathematics as MathML, which browsers draw by themselves, and docstrings as they are written."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.connect("autodoc-process-docstring", _plain_bars)
    app.connect("autodoc-skip-member", _skipped)
