"""The live page draws the shown state, at most thirty times per second."""

import mujoco
import numpy as np
import pytest

from models.world.scene import SceneConfig, world_model
from sim.viewer.live_page import LivePage
from sim.viewer.live_stage import METRES_PER_NEWTON, drawn_at, workspace_position
from sim.viewer.shapes import body_shapes, simplify_shapes
from sim.viewer.shown import Moment, courses

ANGLE = np.linspace(0, 6, 30)
CURVES = 0.05 * np.stack([np.column_stack([np.cos(ANGLE), np.sin(ANGLE), k * np.ones(30)]) for k in range(2)])
DRAWN = courses({"river_names": "one\ntwo", "river_curves": CURVES})
NO_TARGET = np.full(3, np.nan)


@pytest.fixture
def page():
    page = LivePage(world_model(SceneConfig()), DRAWN, 0.02, port=0)
    yield page
    page.close()


def shown_state(model, p=(0.0, 0.0, 0.0), force=(0.0, 0.0, 0.0), target=NO_TARGET, t=0.0, root=0.0) -> Moment:
    qpos = np.array(model.qpos0)
    at = int(model.jnt_qposadr[model.joint("figure/root").id])
    qpos[at] += root
    return Moment(t, qpos, qpos[at : at + 75], np.array(p), np.array(force), np.zeros(3), np.array(target))


def test_force_arrow_starts_at_the_tip_and_points_along_the_force(page):
    stage, tip = page._stage, np.array([0.01, 0.02, 0.03])
    page.show(shown_state(stage._model, tip, (0.0, 0.0, 2.0)))
    start, end = stage._arrows["force"].points[0]
    np.testing.assert_allclose(start, drawn_at(tip), atol=1e-6)
    np.testing.assert_allclose(end - start, [0, 0, 2.0 * METRES_PER_NEWTON], atol=1e-6)
    assert stage._arrows["force"].visible
    assert not stage._arrows["user"].visible  # nobody pushes


@pytest.mark.slow
def test_lag_line_connects_the_stylus_to_its_target(page):
    stage = page._stage
    page.show(shown_state(stage._model, (0.0, 0.0, 0.0), target=(0.01, 0.0, 0.0)))
    assert stage._lag_line.visible
    np.testing.assert_allclose(
        stage._lag_line.points[0], [drawn_at(np.zeros(3)), drawn_at(np.array([0.01, 0, 0]))], atol=1e-6
    )
    stage.show(shown_state(stage._model))
    assert not stage._lag_line.visible


def test_states_that_come_too_fast_are_skipped(page):
    model = page._stage._model
    page.show(shown_state(model))
    page.show(shown_state(model, (1.0, 1.0, 1.0)))
    np.testing.assert_allclose(page._stage._arrows["force"].points[0][0], drawn_at(np.zeros(3)), atol=1e-6)


def test_clock_shows_the_time_of_the_shown_state(page):
    page.show(shown_state(page._stage._model, t=12.34))
    assert "12.34 s" in page._clock.content


@pytest.mark.slow
def test_camera_follows_a_travelling_figure_and_not_a_dancing_one(page):
    stage = page._stage
    stage.show(shown_state(stage._model))
    stage.show(shown_state(stage._model, root=1.0))
    assert np.all(stage._view_offset == 0.0)
    for k in range(200):
        stage.show(shown_state(stage._model, root=1.0 + 0.02 * k, t=0.02 * k))
    assert 3.0 < stage._view_offset[0] < 5.0
    stage.show(shown_state(stage._model))  # reset to the start
    assert np.all(stage._view_offset == 0.0)


def test_taken_at_inverts_drawn_at():
    points = np.random.default_rng(1).normal(size=(5, 3))
    np.testing.assert_allclose(workspace_position(drawn_at(points)), points, atol=1e-15)


def test_coarser_shapes_lie_within_a_cell_of_the_fine_ones():
    fine = body_shapes(world_model(SceneConfig()), "figure/")
    coarse = simplify_shapes(fine, 0.01)
    assert sum(len(s.faces) for s in coarse) < 0.5 * sum(len(s.faces) for s in fine)
    for a, b in zip(fine, coarse, strict=True):
        assert b.faces.max() < len(b.vertices)
        np.testing.assert_allclose(b.vertices.min(axis=0), a.vertices.min(axis=0), atol=0.01)
        np.testing.assert_allclose(b.vertices.max(axis=0), a.vertices.max(axis=0), atol=0.01)


def test_showing_a_state_leaves_the_model_unchanged():
    model = world_model(SceneConfig())
    before = model.qpos0.copy(), model.body_pos.copy(), model.geom_rgba.copy()
    data = mujoco.MjData(model)
    page = LivePage(model, DRAWN, 0.02, port=0)
    page.show(shown_state(model)._replace(qpos=data.qpos + 0.1))
    page.close()
    for array, original in zip((model.qpos0, model.body_pos, model.geom_rgba), before, strict=True):
        assert np.array_equal(array, original)
