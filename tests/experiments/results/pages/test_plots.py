"""Plots of a run's page: recorded values with all peaks, and a cursor that follows the replay."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from experiments.results.pages.plots import MAX_POINTS, plots_html
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording

N = 20_000


def section(tmp_path: Path) -> str:
    force, distance = np.zeros((N, 3)), np.linspace(0.0, 0.01, N)
    force[12_345, 2] = -7.0  # a peak of one tick
    groups = {"ticks": Group(1000.0, {"t": (), "force": (3,), "user": (3,), "distance": ()})}
    with Recorder(tmp_path / "run.h5", {}, 1, groups, {"distance_from": "</script>"}) as recorder:
        rows = {"t": np.arange(N) / 1000.0, "force": force, "user": np.zeros((N, 3)), "distance": distance}
        recorder.append("ticks", rows)
        recorder.close({})
    with Recording(tmp_path / "run.h5") as recording:
        return plots_html(recording)


def test_plot_data_matches_recording_including_a_one_tick_peak(tmp_path: Path) -> None:
    html = section(tmp_path)
    (text,) = re.findall(r'<script type="application/json" id="plot-data">(.*?)</script>', html, re.DOTALL)
    data = json.loads(text)
    assert (data["start"], data["end"]) == (0.0, pytest.approx(19.999))
    distance, forces = data["plots"]
    (line,) = distance["lines"]
    assert len(line["y"]) == MAX_POINTS
    assert line["y"][-1] == pytest.approx(10.0, rel=1e-3)  # [mm]
    field = np.array(forces["lines"][0]["y"])
    assert field.max() == 7.0
    assert np.argmax(field) / MAX_POINTS == pytest.approx(12_345 / N, abs=1.5 / MAX_POINTS)
    assert len(html) < 60_000
    assert "from </script>" not in html


@pytest.mark.processes
def test_browser_wheel_zooms_and_cursor_follows_the_replay(tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = Path("/usr/bin/chromium")
    if not chromium.exists():
        pytest.skip("no chromium in /usr/bin")
    replay = "<div role=slider aria-valuenow=5.5></div>"
    page_file = tmp_path / "page.html"
    page_file.write_text(
        '<!DOCTYPE html><meta name="viewport" content="width=device-width">'
        f'<iframe title="Replay in 3D" srcdoc="{replay}"></iframe>{section(tmp_path)}',
        encoding="utf-8",
    )
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=str(chromium))
        page = browser.new_page(viewport={"width": 390, "height": 844})
        broken: list[str] = []
        page.on("pageerror", lambda error: broken.append(str(error)))
        page.goto(page_file.as_uri())
        output = page.locator("output").first
        page.wait_for_function("document.querySelector('output').textContent.startsWith('5.50 s')")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        box = page.locator("canvas.plot").first.bounding_box()
        assert box is not None
        right = (box["x"] + box["width"] - 12, box["y"] + 30)
        page.mouse.move(*right)
        before = float(output.text_content().split()[0])
        page.mouse.move(box["x"] + 60, right[1])
        for _ in range(8):
            page.mouse.wheel(0, -300)
        page.mouse.move(*right)
        page.wait_for_function(f"parseFloat(document.querySelector('output').textContent) < {before - 10.0}")
        page.locator("#plot-all").click()
        page.mouse.move(*right)
        page.wait_for_function(f"parseFloat(document.querySelector('output').textContent) > {before - 0.5}")
        browser.close()
        assert not broken
