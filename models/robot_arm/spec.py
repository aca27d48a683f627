"""The robot arm as a MuJoCo model, and its link lengths and joint limits for closed-form kinematics."""

from importlib.resources import files

import mujoco
import numpy as np

from geometry.arrays import Array

ARM_JOINTS = tuple(f"joint{i}" for i in range(1, 8))
TOOL = "tool"


def arm_spec() -> mujoco.MjSpec:
    """The arm as an editable MuJoCo model, to be attached into a world: joints and motors joint1…7, site tool."""
    return mujoco.MjSpec.from_string(files("models.robot_arm").joinpath("arm.xml").read_text(encoding="utf-8"))


def arm_model() -> mujoco.MjModel:
    """The arm alone, compiled, its base at the origin."""
    return arm_spec().compile()


def arm_lengths(model: mujoco.MjModel) -> tuple[float, float, float, float]:
    """Link lengths of a compiled arm: base to shoulder, shoulder to elbow, elbow to wrist, wrist to tool [m]."""
    return (
        float(model.body("shoulder_yaw").pos[2]),
        float(model.body("elbow").pos[2]),
        float(model.body("wrist").pos[2]),
        float(model.site(TOOL).pos[2]),
    )


def arm_limits(model: mujoco.MjModel) -> Array:
    """Least and greatest angle of each joint [rad], shape (7, 2), of a compiled arm."""
    return np.array([model.joint(name).range for name in ARM_JOINTS])
