"""The compiled linkage beside the closed form, and configurations to compare them at."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

from geometry.physics import GRAVITY
from models.phantom.kinematics import within_limits
from models.phantom.parameters import PREMIUM_1_5
from models.phantom.spec import GIMBAL_JOINTS, MOTOR_JOINTS, phantom_spec


@dataclass
class Linkage:
    """A compiled Phantom; `closure` (nv, 3) maps θ to all joints, elbow = θ3 − θ2 and twin = θ2 − θ3."""

    model: mujoco.MjModel
    data: mujoco.MjData
    closure: np.ndarray

    def place(self, theta, theta_dot=(0.0, 0.0, 0.0), gimbal=(0.0, 0.0, 0.0)) -> mujoco.MjData:
        self.data.qpos[:] = self.closure @ theta
        self.data.qvel[:] = self.closure @ theta_dot
        for name, angle in zip(GIMBAL_JOINTS, gimbal, strict=True):
            self.data.joint(name).qpos[0] = angle
        mujoco.mj_forward(self.model, self.data)
        return self.data

    def theta(self) -> np.ndarray:
        return np.array([self.data.joint(name).qpos[0] for name in MOTOR_JOINTS])

    def theta_dot(self) -> np.ndarray:
        return np.array([self.data.joint(name).qvel[0] for name in MOTOR_JOINTS])


@pytest.fixture
def linkage() -> Linkage:
    spec = phantom_spec()
    spec.option.gravity = np.array([0.0, -GRAVITY, 0.0])  # along −y of frame P, which is the world's here
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    closure = np.zeros((model.nv, 3))
    for column, name in enumerate(MOTOR_JOINTS):
        closure[model.joint(name).dofadr[0], column] = 1.0
    closure[model.joint("elbow").dofadr[0]] = 0.0, -1.0, 1.0
    closure[model.joint("twin").dofadr[0]] = 0.0, 1.0, -1.0
    return Linkage(model, mujoco.MjData(model), closure)


@pytest.fixture(scope="session")
def configurations() -> np.ndarray:
    """1000 random θ within all limits, shape (1000, 3)."""
    low, high = np.array(PREMIUM_1_5.limit).T
    samples = np.random.default_rng(1).uniform(low, high, (20_000, 3))
    inside = samples[[within_limits(theta) for theta in samples]]
    assert len(inside) >= 1000
    return inside[:1000]
