"""Characters of a name that the font of a plot lacks, and dollar signs."""

import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

from experiments.files.figure_files import drawn
from experiments.trials.analysis.report import levels_figure


def _plot_with_level(name: str) -> Figure:
    figure = Figure()
    figure.subplots().set_xticks([0], [name])
    return figure


def test_characters_that_the_font_lacks_come_from_a_font_that_has_them(capsys: pytest.CaptureFixture[str]) -> None:
    letter = "\u24b6"  # of matplotlib's own STIX fonts
    figure = _plot_with_level(letter)
    drawn(figure, "png")
    families = figure.axes[0].get_xticklabels()[0].get_fontfamily()
    assert any(ord(letter) in get_font(findfont(family)).get_charmap() for family in families[1:])
    assert capsys.readouterr().err == ""


def test_character_that_no_font_has_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert drawn(_plot_with_level("slow \U0010fffd"), "png").startswith(b"\x89PNG")
    assert capsys.readouterr().err.strip() == "No installed font has \U0010fffd, which a plot shows as boxes."


def test_dollar_signs_in_names_of_levels_are_no_formula() -> None:
    levels = [r"$\foo$", "$5"]
    rows = [("done", user, level, other, 1.0) for user in (0, 1) for level in levels for other in ("$a", "$b")]
    frame = pd.DataFrame(rows, columns=["state", "user", "price", "other", "tracking_error"])
    assert drawn(levels_figure(frame, "price", levels, ["other"], "tracking_error"), "png")
