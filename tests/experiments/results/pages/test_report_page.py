"""The report of a run is one self-contained file."""

import json
from html.parser import HTMLParser

import numpy as np
import pytest

import hvf
from experiments.cli import main
from experiments.results.pages import report
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.viewer.palette import RIVERS

REPLAY = '<html><body class="a">3 & 4 < 5</body></html>'


class Page(HTMLParser):
    """Texts and attributes of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.texts: list[str] = []
        self.attributes: dict[str, list[str]] = {}
        self.tags: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        for name, value in attrs:
            self.attributes.setdefault(name, []).append(value or "")

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "replay_html", lambda recording, model: REPLAY)
    (tmp_path / "path.png").write_bytes(b"\x89PNG not really")

    def write(radius=0.02, lines=("It worked.",), texts=None):
        static = {"curve": 0.05 * np.eye(3), "tube_radius": radius, **(texts or {})}
        with Recorder(tmp_path / f"{radius}.h5", {}, 42, {"ticks": Group(10, {"t": ()})}, static) as recorder:
            recorder.append("ticks", {"t": np.arange(3000) / 10})
            recorder.close({})
        with Recording(tmp_path / f"{radius}.h5") as recording:
            report.write_report(tmp_path / "r.html", recording, None, "A <run>", lines, [tmp_path / "path.png"])
        return Page((tmp_path / "r.html").read_text(encoding="utf-8"))

    return write


def test_replay_is_embedded_unchanged(write):
    assert write().attributes["srcdoc"] == [REPLAY]


def test_lines_are_escaped(write):
    page = write(lines=("<script>alert(1)</script>", "a & b"))
    assert "script" not in page.tags
    assert {"<script>alert(1)</script>", "a & b"} <= set(page.texts)


def test_page_fetches_nothing(write):
    page = write()
    assert all(value.startswith("data:") for name in ("src", "href") for value in page.attributes[name])
    assert page.attributes["src"] == ["data:image/png;base64,iVBORyBub3QgcmVhbGx5"]


def test_page_states_what_is_not_to_scale(write):
    assert "drawn with a radius of 15 mm for its 250 mm" in " ".join(write(radius=0.25).texts)
    assert "drawn with a radius" not in " ".join(write(radius=0.002).texts)
    assert "first 60 of 300 seconds" in " ".join(write(radius=0.003).texts)


def test_page_names_the_tube(write):
    assert "Light blue: the tube around the curve" in " ".join(" ".join(write(radius=0.004).texts).split())


def test_rivers_are_named_in_their_colours(write):
    rivers = {"river_names": "level\nhi & lo", "river_curves": 0.05 * np.ones((2, 3, 1)) * np.eye(3)}
    page = write(radius=0.004, texts=rivers)
    assert "The rivers, each in its tube: level , hi & lo ." in " ".join(" ".join(page.texts).split())
    styles = page.attributes["style"]
    assert [f"color:{color}" in styles for color in RIVERS[:3]] == [True, True, False]


def test_page_without_tube_does_not_mention_one(write):
    assert "Light blue" not in " ".join(write(radius=0.0).texts)


def test_seed_and_versions_are_shown(write):
    text = " ".join(write().texts)
    assert "seed 42" in text
    assert f"numpy {np.__version__}" in text


@pytest.mark.slow
def test_remarks_before_a_run_are_in_its_summary_and_on_its_page(tmp_path, capsys) -> None:
    hvf.run(user="turn", figure="none", seconds=1.5, record=tmp_path / "turned")
    (remark,) = json.loads((tmp_path / "turned" / "summary.json").read_text())["remarks"]
    assert "ignores its orientation" in remark
    assert remark in Page((tmp_path / "turned" / "report.html").read_text()).texts
    assert main(["report", str(tmp_path / "turned")]) == 0
    assert remark in capsys.readouterr().out.splitlines()
