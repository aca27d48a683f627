"""Plots as files that are complete or do not exist."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from geometry.whole_files import atomic_file


def save_figure(figure: Figure, path: Path, **options: Any) -> None:
    """Write a plot in the format of the file's suffix, with options of `Figure.savefig`; raises as `atomic_file`."""
    with atomic_file(path) as file:
        figure.savefig(file, format=path.suffix[1:], **options)
