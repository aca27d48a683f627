"""The world of a robot arm: one MuJoCo model with Phantom and arm, and its state."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from controllers.state import Array
from models.robot_arm.spec import ARM_JOINTS, arm_model
from models.world.scene import ROBOT, SceneConfig, robot_world_model
from sim.world.world import place_stylus


@dataclass(frozen=True)
class RobotWorld:
    """One MuJoCo model with Phantom and robot arm, and its state.

    Parameters
    ----------
    config : SceneConfig
        Servo period and physics step; stature and mass are unused.

    Raises
    ------
    ModelError
        If the servo period is not a multiple of the physics step.
    """

    config: SceneConfig = field(default_factory=SceneConfig)
    model: mujoco.MjModel = field(init=False, repr=False)
    data: mujoco.MjData = field(init=False, repr=False)
    arm: mujoco.MjModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        model = robot_world_model(self.config)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "data", mujoco.MjData(model))
        object.__setattr__(self, "arm", arm_model())

    @property
    def ground(self) -> Array:
        """Ground reaction force [N], shape (3,): zero, since nothing in this world walks."""
        return np.zeros(3)

    def reset(self, p_H: Array) -> None:
        """Put the stylus at a point of H [m], shape (3,), at rest, and the arm straight up.

        Raises
        ------
        SimError
            If the Phantom cannot reach the point.
        """
        place_stylus(self.model, self.data, p_H)
        mujoco.mj_forward(self.model, self.data)

    def put_arm(self, q: Array) -> None:
        """Put the arm at joint angles [rad], shape (7,), at rest."""
        first = int(self.model.joint(ROBOT + ARM_JOINTS[0]).qposadr[0])
        self.data.qpos[first : first + len(q)] = q
        mujoco.mj_forward(self.model, self.data)
