"""A map of a figure of another size: all points of the body in proportion, its derivative, and what it wraps."""

import mujoco
import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.base import finite_differences
from controllers.haptic_map.cylindrical import CYLINDRICAL, Cylindrical
from controllers.haptic_map.evaluate import evaluate_map_jacobian, kinds_of
from controllers.haptic_map.expressive import EXPRESSIVE
from controllers.haptic_map.sized import SIZED, Sized, innermost, size_of
from experiments.setups.parts.expression import expressive_figure
from models.humanoid.skeleton import DEFAULT_STATURE, FOOT_CONTACTS, figure_model
from models.mocap.library import embedded
from sim.compilation.kernel_units import map_units
from tests.controllers.clips_for_maps import stylus

WALK = embedded("walk")
BASE = expressive_figure(Cylindrical([(WALK.poses, WALK.fps)] * 4, (0.03, 0.07), (-0.02, 0.02)))
SIZE = 1.2 / DEFAULT_STATURE
MAP = Sized(BASE, SIZE)
STYLUS = stylus(0.05, 1.0, 0.003)


def soles(stature: float, pose: np.ndarray) -> np.ndarray:
    figure = figure_model(stature)
    data = mujoco.MjData(figure)
    data.qpos[:] = pose
    mujoco.mj_kinematics(figure, data)
    return data.geom_xpos[[figure.geom(name).id for name in FOOT_CONTACTS]]


def test_every_point_of_the_body_is_in_proportion() -> None:
    np.testing.assert_allclose(soles(1.2, MAP.pose(STYLUS)), SIZE * soles(1.75, BASE.pose(STYLUS)), atol=1e-12)


def test_the_derivative_is_that_of_the_pose() -> None:
    np.testing.assert_allclose(MAP.jacobian(STYLUS), finite_differences(MAP.pose, STYLUS), rtol=2e-6, atol=2e-6)


def test_the_tick_evaluates_it_as_python_does() -> None:
    kind, params, memory = MAP.compiled()
    pose, jacobian = np.empty(MAP.nq), np.empty((MAP.nv, 6))
    evaluate_map_jacobian(map_units([(kind, params)]), kind, params, STYLUS, memory, pose, jacobian)
    np.testing.assert_array_equal(pose, MAP.pose(STYLUS))
    np.testing.assert_array_equal(jacobian, MAP.jacobian(STYLUS))


def test_it_needs_the_kernels_of_all_that_it_wraps() -> None:
    kind, params, _ = MAP.compiled()
    assert kinds_of(kind, params) == (SIZED, EXPRESSIVE, CYLINDRICAL)
    assert innermost.py_func(kind, params)[0] == CYLINDRICAL
    assert size_of.py_func(kind, params) == SIZE
    assert size_of.py_func(*BASE.compiled()[:2]) == 1.0


@pytest.mark.parametrize("size", [0.0, -1.0, np.inf, np.nan])
def test_a_size_that_none_has_is_refused(size: float) -> None:
    with pytest.raises(ParameterError, match="expected more than 0, and finite"):
        Sized(BASE, size)
