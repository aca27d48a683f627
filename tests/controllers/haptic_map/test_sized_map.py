"""The map of a figure of another size: body points in proportion, the Jacobian, and the order of its kernels."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.cylindrical import Cylindrical, cylindrical_map
from controllers.haptic_map.expressive import express
from controllers.haptic_map.map_stages import first_params, kernels_of
from controllers.haptic_map.sized import Sized, size_pose
from experiments.setups.parts.expression import expressive_figure
from models.humanoid.skeleton import DEFAULT_STATURE, FOOT_CONTACTS, figure_model
from models.mocap.library import embedded
from models.mocap.motion.kinematics import contact_points
from tests.controllers.clips_for_maps import assert_same_compiled, difference, displaced, stylus
from tests.derivatives import central_differences

WALK = embedded("walk")
BASE = expressive_figure(Cylindrical([(WALK.poses, WALK.fps)] * 4, (0.03, 0.07), (-0.02, 0.02)))
SIZE = 1.2 / DEFAULT_STATURE
MAP = Sized(BASE, SIZE)
STYLUS = stylus(0.05, 1.0, 0.003)


def soles(stature: float, pose: np.ndarray) -> np.ndarray:
    return contact_points(pose[None], FOOT_CONTACTS, figure_model(stature))[0]


def test_sole_points_scale_with_the_figure() -> None:
    np.testing.assert_allclose(soles(1.2, MAP.pose(STYLUS)), SIZE * soles(1.75, BASE.pose(STYLUS)), atol=1e-12)


def test_jacobian_matches_finite_differences() -> None:
    numeric = central_differences(lambda d: MAP.pose(displaced(STYLUS, d)), np.zeros(6), 1e-5, difference)
    np.testing.assert_allclose(MAP.jacobian(STYLUS), numeric, rtol=2e-6, atol=2e-6)


def test_compiled_map_is_identical() -> None:
    assert_same_compiled(MAP, STYLUS)


def test_kernels_run_after_those_of_the_wrapped_maps() -> None:
    stages, params, _, size = MAP.compiled()
    assert kernels_of(stages) == (cylindrical_map, express, size_pose)
    np.testing.assert_array_equal(first_params.py_func(stages, params), BASE.base.compiled().params)
    assert (size, BASE.compiled().size) == (SIZE, 1.0)


@pytest.mark.parametrize("size", [0.0, -1.0, np.inf, np.nan])
def test_invalid_size_raises_parameter_error(size: float) -> None:
    with pytest.raises(ParameterError, match="expected more than 0, and finite"):
        Sized(BASE, size)
