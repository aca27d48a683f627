"""The figure that maps move."""

import mujoco
import pytest

from models.humanoid.skeleton import figure_model


@pytest.fixture(scope="session")
def figure() -> mujoco.MjModel:
    return figure_model()
