"""Figures of a run show the recorded values in the stated units."""

import itertools
import os
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.image import imread

from experiments.results.measures.changes import RiverChange
from experiments.results.pages import figures
from experiments.results.pages.figures import (
    MAX_POINTS,
    STYLE,
    deviation_figure,
    draw_figures,
    forces_figure,
    path_figure,
    torques_figure,
    tracking_figure,
)
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording

ANGLE = np.linspace(0, 2 * np.pi, 61)
CURVE = 0.05 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE])
TICKS = {"t": (), "p": (3,), "distance": (), "force": (3,), "user": (3,), "torque": (3,), "river": ()}
FRAMES = {"t": (), "joint_error": (), "root_error": (), "residual": (6,), "ground": (3,), "flight": (), "down": ()}


def record(path, n=2000, pushing=True, texts=None, summary=None):
    """A hand on a circle, pushed outwards from 0.5 s to 0.7 s; a flight from 1.0 s to 1.2 s."""
    t = np.arange(n) / 1000
    pushed = pushing * ((t >= 0.5) & (t < 0.7)).astype(float)
    outwards = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    rows = t[::10]
    flight = ((rows >= 0.995) & (rows < 1.195)).astype(float)
    standing = (1 - flight)[:, None]
    static = {
        "curve": CURVE,
        "tube_radius": 0.02,
        "motor_continuous": np.array([0.4, 0.3, 0.2]),
        "motor_peak": np.array([1.6, 1.2, 0.8]),
        "body_weight": 700.0,
        **(texts or {}),
    }
    with Recorder(path, {}, 1, {"ticks": Group(1000, TICKS), "frames": Group(100, FRAMES)}, static) as recorder:
        recorder.append(
            "ticks",
            {
                "t": t,
                "p": (0.05 + 0.01 * pushed)[:, None] * outwards,
                "distance": 0.01 * pushed,
                "force": np.tile([1.0, 2.0, 2.0], (n, 1)),
                "user": 2.0 * pushed[:, None] * outwards,
                "torque": np.tile([0.1, -0.2, 0.3], (n, 1)),
                "river": 0.0 * t,
            },
        )
        recorder.append(
            "frames",
            {
                "t": rows,
                "joint_error": np.full(len(rows), np.pi / 180),
                "root_error": np.full(len(rows), 0.02),
                "residual": standing * np.array([42.0, 0.0, 56.0, 9.0, 9.0, 9.0]),
                "ground": standing * np.array([0.0, 0.0, 700.0]),
                "flight": flight,
                "down": ((rows >= 1.495) & (rows < 1.695)).astype(float),
            },
        )
        recorder.close(summary or {})
    return Recording(path)


@pytest.fixture
def recording(tmp_path):
    with record(tmp_path / "run.h5") as recording:
        yield recording


def line(ax, label):
    return next(line for line in ax.lines if line.get_label() == label)


def values(ax, label):
    return line(ax, label).get_ydata()


def spans(ax):
    """Shaded intervals of the horizontal axis."""
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in ax.patches]


@pytest.mark.slow
def test_all_figures_are_drawn_into_a_new_folder(recording, tmp_path):
    files = draw_figures(recording, tmp_path / "run" / "figures")
    assert [file.name for file in files] == ["path.png", "deviation.png", "forces.png", "torques.png", "figure.png"]
    for file in files:
        pixels = imread(file)
        assert pixels.shape[1] == 1080
        assert np.ptp(pixels[..., :3]) > 0.5


def test_path_is_in_millimetres_with_pushes_marked(recording):
    above, right = path_figure(recording).axes
    hand = np.array(line(above, "hand").get_data())
    assert np.linalg.norm(hand[:, [100, 600]], axis=0) == pytest.approx([50.0, 60.0])
    assert np.flatnonzero(np.isfinite(line(above, "where the hand pushes").get_ydata())).tolist() == list(
        range(500, 700)
    )
    assert np.linalg.norm(np.array(line(above, "curve φ").get_data()), axis=0) == pytest.approx(np.full(61, 50.0))
    assert np.all(line(right, "hand").get_ydata() == 0.0)


def test_labels_of_hand_and_tube_come_from_the_recording(tmp_path):
    texts = {"hand_does": "leads", "tube_name": "map's domain"}
    with record(tmp_path / "led.h5", texts=texts) as led:
        drawn = {line.get_label() for line in path_figure(led).axes[0].lines}
        labels = deviation_figure(led).axes[0].get_legend_handles_labels()[1]
    assert {"where the hand leads", "map's domain"} <= drawn
    assert "hand leads" in labels
    with record(tmp_path / "alone.h5", pushing=False) as alone:
        assert not any("where" in str(line.get_label()) for line in path_figure(alone).axes[0].lines)


def test_rivers_are_drawn_by_name_and_distance_names_its_reference(tmp_path):
    texts = {
        "river_names": "level\nhigh",
        "river_curves": np.stack([CURVE, CURVE + np.array([0.0, 0.0, 0.01])]),
        "distance_from": "its river",
    }
    with record(tmp_path / "rivers.h5", texts=texts) as rivers:
        _, right = path_figure(rivers).axes
        deviation = deviation_figure(rivers).axes[0].get_title()
    assert [np.max(values(right, name)) for name in ("level", "high")] == pytest.approx([0.0, 10.0])
    assert line(right, "level").get_color() != line(right, "high").get_color()
    assert not any(line.get_label() == "curve φ" for line in right.lines)
    assert deviation == "distance of the hand from its river"


def test_curve_without_tube_draws_none(tmp_path):
    with record(tmp_path / "led.h5", texts={"tube_radius": 0.0}) as led:
        assert "tube" not in {line.get_label() for line in path_figure(led).axes[0].lines}
        assert len(deviation_figure(led).axes[0].lines) == 1


def test_names_of_close_changes_do_not_overlap(tmp_path, monkeypatch):
    changes = [RiverChange(t, "", name) for t, name in ((0.5, "wave"), (0.55, "high"), (0.6, "level"), (1.5, "wave"))]
    monkeypatch.setattr(figures, "river_changes", lambda recording: tuple(changes))
    with record(tmp_path / "rivers.h5") as rivers:
        figure = deviation_figure(rivers)
    figure.draw_without_rendering()
    for ax in figure.axes:
        boxes = [text.get_window_extent() for text in ax.texts]
        assert len(boxes) == 4
        assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
        assert boxes[0].y0 == boxes[3].y0


DRAWINGS = (path_figure, deviation_figure, forces_figure, torques_figure, tracking_figure)


@pytest.mark.parametrize("draw", DRAWINGS, ids=lambda draw: draw.__name__)
def test_legends_do_not_cover_data_and_text_is_not_clipped(draw, recording):
    with mpl.rc_context(STYLE):
        figure = draw(recording)
        figure.draw_without_rendering()
    legends = [legend for legend in (*figure.legends, *(ax.get_legend() for ax in figure.axes)) if legend is not None]
    assert legends
    boxes = [legend.get_window_extent().shrunk(0.98, 0.98) for legend in legends]
    assert not any(box.overlaps(ax.get_window_extent()) for box in boxes for ax in figure.axes)
    drawn = figure.get_tightbbox()
    assert min(drawn.x0, drawn.y0) >= 0.0
    width, height = figure.get_size_inches()
    assert drawn.x1 <= width
    assert drawn.y1 <= height


def test_whole_tube_is_in_view(recording):
    figure = path_figure(recording)
    figure.draw_without_rendering()
    for ax in figure.axes:
        (x_low, x_high), (y_low, y_high) = ax.get_xlim(), ax.get_ylim()
        tube = 1e3 * (CURVE[:, :2] if ax is figure.axes[0] else CURVE[:, ::2])
        assert x_low < tube[:, 0].min() - 20.0 < tube[:, 0].max() + 20.0 < x_high
        assert y_low < tube[:, 1].min() - 20.0 < tube[:, 1].max() + 20.0 < y_high


def test_start_of_performance_is_marked(tmp_path):
    with record(tmp_path / "bent.h5", summary={"performance": {"start": 1.25}}) as bent:
        for figure in (deviation_figure(bent), tracking_figure(bent)):
            assert all("performed" in [text.get_text() for text in ax.texts] for ax in figure.axes)


def test_deviation_is_in_millimetres_with_pushes_shaded(recording):
    full, magnified = deviation_figure(recording).axes
    assert np.max(full.lines[-1].get_ydata()) == pytest.approx(10.0)
    assert spans(full) == [(pytest.approx(0.5), pytest.approx(0.699))]
    assert magnified.get_ylim()[1] < 1.0 < 10.0 < full.get_ylim()[1]


def test_forces_are_shown_by_component_and_norm(recording):
    field, hand = forces_figure(recording).axes
    assert [values(field, label)[0] for label in ("x", "y", "z", "norm")] == [1.0, 2.0, 2.0, 3.0]
    assert np.max(values(hand, "norm")) == pytest.approx(2.0)


def test_torques_are_shown_with_motor_limits(recording, tmp_path):
    axes = torques_figure(recording).axes
    for ax, torque, continuous, peak in zip(axes, (100, -200, 300), (400, 300, 200), (1600, 1200, 800), strict=True):
        assert ax.lines[0].get_ydata()[0] == pytest.approx(torque)
        assert values(ax, "continuous")[0] == pytest.approx(continuous)
        low, high = ax.get_ylim()
        assert low < torque < high
        assert f"{continuous} mN m continuous, {peak} mN m peak" in ax.get_title()
        # A line that is not in view is not in the legend.
        assert all(low <= line.get_ydata()[0] <= high for line in ax.lines)
    with record(tmp_path / "weak.h5", texts={"motor_peak": np.array([0.15, 0.2, 0.25])}) as weak:
        peaks = [values(ax, "peak")[0] for ax in torques_figure(weak).axes]
    assert peaks == pytest.approx([150.0, 200.0, 250.0])


def test_tracking_figure_units_and_shaded_flights_and_falls(recording):
    axes = tracking_figure(recording).axes
    assert [ax.lines[0].get_ydata()[0] for ax in axes] == pytest.approx([1.0, 2.0, 10.0, 100.0])
    flight, fallen = (1.0, 1.19), (1.5, 1.69)
    assert all(spans(ax) == [pytest.approx(flight), pytest.approx(fallen)] for ax in axes)
    t, shown = axes[0].lines[0].get_data()
    assert np.all(np.isnan(shown) == ((t > 1.495) & (t < 1.695)))
    assert axes[2].lines[0].get_ydata()[110] == 0.0


def test_long_recording_is_thinned(tmp_path):
    with record(tmp_path / "long.h5", n=3 * MAX_POINTS + 7) as recording:
        drawn = values(path_figure(recording).axes[0], "hand")
    assert MAX_POINTS / 2 < len(drawn) <= MAX_POINTS


def test_nothing_is_shaded_without_pushes(tmp_path):
    with record(tmp_path / "calm.h5", pushing=False) as recording:
        full, _ = deviation_figure(recording).axes
        assert spans(full) == []
        assert full.get_legend() is None


@pytest.mark.slow
def test_figures_need_no_display(tmp_path):
    record(tmp_path / "run.h5").close()
    script = (
        "import sys; from pathlib import Path; from sim.recording.recording import Recording; "
        "from experiments.results.pages.figures import draw_figures; "
        "draw_figures(Recording(Path(sys.argv[1])), Path(sys.argv[2])); "
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"} | {"MPLBACKEND": "tkagg"}
    completed = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "run.h5", tmp_path], env=environment, check=False
    )
    assert completed.returncode == 0
