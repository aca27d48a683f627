"""Gravity has one value in code and compiled MuJoCo models."""

import numpy as np
import pytest

from geometry.physics import GRAVITY
from models.humanoid.skeleton import figure_model
from models.world.scene import SceneConfig, device_world_model, world_model


@pytest.mark.parametrize("build_model", [world_model, device_world_model, lambda config: figure_model(config.stature)])
def test_compiled_models_have_the_gravity_of_the_code(build_model) -> None:
    np.testing.assert_array_equal(build_model(SceneConfig()).opt.gravity, (0.0, 0.0, -GRAVITY))
