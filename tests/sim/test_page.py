"""The live page draws the state it is shown, at most thirty times a second."""

import mujoco
import numpy as np
import pytest

from models.scene import P_WH, SceneConfig, world_model
from sim.viewer.courses import courses
from sim.viewer.live_page import LivePage
from sim.viewer.page import NullPage

ANGLE = np.linspace(0, 6, 30)
CURVES = 0.05 * np.stack([np.column_stack([np.cos(ANGLE), np.sin(ANGLE), k * np.ones(30)]) for k in range(2)])
DRAWN = courses({"river_names": "one\ntwo", "river_curves": CURVES})


@pytest.fixture
def page():
    page = LivePage(world_model(SceneConfig()), DRAWN, 0.02, P_WH, port=0)
    yield page
    page.close()


def test_the_force_is_drawn_from_the_tip_along_the_force(page):
    tip, force = np.array([0.01, 0.02, 0.03]), np.array([0.0, 0.0, 2.0])
    page.show(np.array(page._model.qpos0), tip, force)
    start, end = page._arrow.points[0]
    np.testing.assert_allclose(start, P_WH + tip, atol=1e-6)
    np.testing.assert_allclose(end - start, [0, 0, 0.2], atol=1e-6)


def test_states_that_come_too_fast_are_skipped(page):
    qpos = np.array(page._model.qpos0)
    page.show(qpos, np.zeros(3), np.zeros(3))
    page.show(qpos, np.ones(3), np.zeros(3))
    np.testing.assert_allclose(page._arrow.points[0][0], P_WH, atol=1e-6)


def test_showing_a_state_does_not_touch_the_model_that_runs():
    model = world_model(SceneConfig())
    data = mujoco.MjData(model)
    before = model.qpos0.copy(), model.body_pos.copy(), model.geom_rgba.copy()
    NullPage().show(data.qpos, np.zeros(3), np.zeros(3))
    page = LivePage(model, DRAWN, 0.02, P_WH, port=0)
    page.show(data.qpos + 0.1, np.zeros(3), np.zeros(3))
    page.close()
    for array, kept in zip((model.qpos0, model.body_pos, model.geom_rgba), before, strict=True):
        assert np.array_equal(array, kept)
