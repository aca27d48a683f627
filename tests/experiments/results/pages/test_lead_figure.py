"""The figure of a led run: contents, units, and no overlapping text."""

import matplotlib as mpl
import numpy as np
import pytest

from experiments.results.pages.figures import STYLE
from experiments.results.pages.mode_figures import lead_figure
from models.humanoid.skeleton import rest_pose
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording

TURNED, SECONDS = 4.0, 9.0


@pytest.fixture
def figure(tmp_path):
    """A figure that moves 4 m along x in 4 s and back; a stylus in front of it, at a scale of 1:100."""
    t, rows = np.arange(0.0, SECONDS, 1e-3), np.arange(0.0, SECONDS, 1e-2)
    s = np.minimum(t, np.maximum(2.0 * TURNED - t, 0.0))
    poses = np.tile(rest_pose(), (len(rows), 1))
    poses[:, 0] = s[::10]
    groups = {
        "ticks": Group(1000, {"phase": (), "p": (3,), "force": (3,)}),
        "frames": Group(100, {"t": (), "qpos": (76,), "reference": (75,)}),
    }
    static = {"lead_scale": 100.0, "lead_stride": 1.0, "lead_support": np.repeat([2.0, 1.0, 0.0, 1.0], 25)}
    with Recorder(tmp_path / "run.h5", {}, 1, groups, static) as recorder:
        hand, force = np.outer(s + 0.5, [0.01, 0.0, 0.0]), np.outer(np.sin(t), [1.0, 2.0, 3.0])
        recorder.append("ticks", {"phase": s, "p": hand, "force": force})
        recorder.append("frames", {"t": rows, "qpos": np.hstack((0.0 * poses[:, :1], poses)), "reference": poses})
        recorder.close({})
    with Recording(tmp_path / "run.h5") as recording, mpl.rc_context(STYLE):
        figure = lead_figure(recording)
        figure.draw_without_rendering()
        yield figure


def test_paths_speed_and_force_have_si_units(figure) -> None:
    above, moving, feeling = figure.axes
    ways = {line.get_label(): line.get_xdata() for line in above.lines}
    assert (ways["stylus, forth"].min(), ways["stylus, forth"].max()) == pytest.approx((0.5, 4.5))
    assert (ways["animation, back"][0], ways["animation, back"][-1]) == pytest.approx((4.0, 0.0))
    assert len(ways["physical figure"]) == 900
    speed = moving.lines[0].get_ydata()
    assert (speed[100], speed[600]) == pytest.approx((1.0, -1.0))
    force = {line.get_label(): np.max(line.get_ydata()) for line in feeling.lines}
    assert [force[f"along {axis}"] for axis in "xyz"] == pytest.approx([1.0, 2.0, 3.0], rel=1e-3)
    assert [ax.get_ylabel() for ax in figure.axes] == ["y [m]", "ds/dt [m/s]", "F [N]"]
    assert (above.get_xlabel(), feeling.get_xlabel()) == ("x [m]", "time [s]")


def test_shaded_phases_are_named_and_the_turn_is_marked(figure) -> None:
    _, moving, feeling = figure.axes
    assert {text.get_text() for text in moving.get_legend().get_texts()} == {
        "on two feet",
        "in flight",
        "it turns back",
    }
    assert all(ax.lines[-1].get_xdata()[0] == pytest.approx(TURNED) for ax in (moving, feeling))


def test_legends_do_not_cover_data_or_titles_and_text_is_not_clipped(figure) -> None:
    drawn = [ax.get_window_extent() for ax in figure.axes]
    for ax in figure.axes:
        legend = ax.get_legend().get_window_extent()
        assert not any(legend.shrunk(0.98, 0.98).overlaps(box) for box in drawn)
        title = ax._left_title.get_window_extent()
        assert title.x0 >= 0.0
        assert title.x1 <= figure.bbox.x1
        assert not title.overlaps(legend)
