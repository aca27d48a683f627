"""The paper's figures: outlines of the figure, and all eight drawn from runs."""

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.config.run_config import Figure, RunConfig
from experiments.paper_figures.draw import DRAWINGS, PAGE, draw_all, draw_one
from experiments.paper_figures.silhouettes import Silhouettes
from experiments.paper_figures.sources import configs
from experiments.render.graphics import NoGraphics, offscreen_backend
from models.humanoid.skeleton import rest_pose
from sim.errors import SimError


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 2.6])
def test_outline_of_figure_at_rest_has_its_height_and_arm_span(azimuth: float) -> None:
    corners = np.concatenate([outline.corners for outline in Silhouettes().outlines(rest_pose(), azimuth)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    assert low[1] == pytest.approx(0.0, abs=2e-3)
    assert high[1] == pytest.approx(1.75, abs=0.03)
    # Seen along the arms their span of 1.8 m vanishes, seen across them all of it is visible.
    assert high[0] - low[0] == pytest.approx(max(0.3, 1.82 * abs(np.cos(azimuth))), abs=0.2)


def test_farther_bodies_are_drawn_first() -> None:
    outlines = Silhouettes().outlines(rest_pose(), 0.5 * np.pi)  # looking to the left: the left arm is farther away
    order = [outline.body for outline in outlines]
    assert order.index("left_hand") < order.index("right_hand")


def test_every_drawing_has_a_number_and_its_runs() -> None:
    assert [drawing.number for drawing in DRAWINGS] == list(range(1, 9))
    assert {name for drawing in DRAWINGS for name in drawing.runs} == set(configs())
    assert all(isinstance(config, RunConfig) for config in configs().values())


def test_existing_figures_are_not_replaced_without_overwrite(tmp_path: Path) -> None:
    (tmp_path / PAGE).write_text("mine")
    with pytest.raises(SimError, match="--overwrite"):
        draw_all(tmp_path, time.perf_counter())
    assert (tmp_path / PAGE).read_text() == "mine"


@pytest.mark.slow
def test_all_eight_figures_are_written_as_pdf_and_png(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        offscreen_backend()
    except NoGraphics as error:
        pytest.skip(str(error))
    monkeypatch.setattr("experiments.paper_figures.draw.DPI", 60)
    # Faster: no report pages, and kinematic figures.
    monkeypatch.setattr("experiments.results.pages.report.write_report", lambda *_: None)
    kinematic = {name: replace(config, figure=Figure(kind="kinematic")) for name, config in configs().items()}
    monkeypatch.setattr("experiments.paper_figures.draw.configs", lambda: kinematic)
    files = draw_all(tmp_path, time.perf_counter())
    assert len(files) == 8
    for file in files:
        assert file.stat().st_size > 8_000
        pdf = file.with_suffix(".pdf").read_bytes()
        assert pdf.startswith(b"%PDF")
        # Vector graphics: only the rendered figure contains a raster image.
        assert (b"/Subtype /Image" in pdf) == (file.stem == "figure-7")
    page = (tmp_path / PAGE).read_text(encoding="utf-8")
    assert len(re.findall(r"<figure ", page)) == 8
    before = files[0].read_bytes()
    assert draw_one(DRAWINGS[0], tmp_path / "runs", tmp_path).read_bytes() == before
