"""Gravity is one number, wherever it is written."""

import numpy as np
import pytest

from controllers.gravity import GRAVITY as IN_CONTROLLERS
from models.gravity import GRAVITY
from models.humanoid.skeleton import figure_model
from models.world.scene import SceneConfig, device_world_model, world_model


def test_controllers_calculate_with_the_gravity_of_the_models() -> None:
    assert IN_CONTROLLERS == GRAVITY


@pytest.mark.parametrize("make", [world_model, device_world_model, lambda config: figure_model(config.stature)])
def test_a_compiled_world_has_that_gravity(make) -> None:
    np.testing.assert_array_equal(make(SceneConfig()).opt.gravity, (0.0, 0.0, -GRAVITY))
