"""The world: the compiled MuJoCo model of Phantom and figure or robot arm, its state, and its initial state."""

from copy import copy
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import mujoco
import numpy as np

from geometry.arrays import Array
from geometry.vectors import Quaternion
from models.humanoid.skeleton import figure_model
from models.phantom.kinematics import (
    gimbal_angles,
    inverse_kinematics,
    jacobian,
    linkage_angles,
    vector_to_device_frame,
    within_limits,
)
from models.phantom.spec import GIMBAL_JOINTS, LINKAGE_JOINTS
from models.robot_arm.spec import ARM_JOINTS, arm_model
from models.world.scene import FIGURE, PHANTOM, ROBOT, SceneConfig, device_world_model, robot_world_model, world_model
from sim.errors import SimError

FigureKind: TypeAlias = Literal["physical", "kinematic", "none"]
"""The figure in a world: simulated physically; kinematic, its pose h(p) only evaluated and recorded; or none."""
BodyKind: TypeAlias = Literal[FigureKind, "robot"]
"""What follows the hand in a world: a figure of some kind, or a robot arm."""

_FIRST_JOINTS: dict[BodyKind, str] = {"physical": FIGURE + "root", "robot": ROBOT + ARM_JOINTS[0]}


@dataclass(frozen=True)
class World:
    """One MuJoCo model with Phantom and figure or robot arm, and its state.

    Parameters
    ----------
    config : SceneConfig
        Stature and mass of the figure, servo period and physics step.
    kind : BodyKind
        ``physical``: the figure is simulated together with the Phantom. ``kinematic``: it is not in the physics, and is
        shown in the animation's pose. ``none``: there is no figure. ``robot``: a robot arm is simulated in its place.

    Attributes
    ----------
    body : MjModel
        Model of the figure, or of the robot arm, alone; poses and tangents of animations are its qpos and qvel.

    Raises
    ------
    ModelError
        If the servo period is not a multiple of the physics step, or stature or mass are outside their intervals.
    SimError
        If there is no such kind.
    """

    config: SceneConfig = field(default_factory=SceneConfig)
    kind: BodyKind = "physical"
    model: mujoco.MjModel = field(init=False, repr=False)
    data: mujoco.MjData = field(init=False, repr=False)
    body: mujoco.MjModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in get_args(BodyKind):
            raise SimError(f"kind is {self.kind!r}; expected one of {', '.join(get_args(BodyKind))}")
        model, body = (copy(compiled) for compiled in _compiled_models(self.config, self.kind))
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "data", mujoco.MjData(model))
        object.__setattr__(self, "body", body)

    def reset(
        self,
        p_H: Array,
        pose: Array,
        q_HS: Quaternion | None = None,
        v_H: Array | None = None,
        velocity: Array | None = None,
    ) -> None:
        """Put the stylus at a point and the body in a pose, at rest or in motion.

        Parameters
        ----------
        p_H : Array
            Stylus tip in the hand frame [m], shape (3,).
        pose : Array
            Pose of the figure, shape (75,), or joint angles of the arm [rad], shape (7,); used only if the body is in
            the physics.
        q_HS : Quaternion, optional
            Orientation of the stylus, unit quaternion wxyz; by default the gimbal's joints are at zero.
        v_H : Array, optional
            Velocity of the stylus tip [m/s], shape (3,); by default it rests.
        velocity : Array, optional
            Velocity of the body, shape (57,) or (7,); by default it rests.

        Raises
        ------
        SimError
            If the Phantom cannot reach the point.
        """
        place_stylus(self.model, self.data, p_H, q_HS, v_H)
        if self.kind in _FIRST_JOINTS:
            velocity_at = int(self.model.joint(_FIRST_JOINTS[self.kind]).dofadr[0])
            self.data.qpos[self.pose_at : self.pose_at + len(pose)] = pose
            if velocity is not None:
                self.data.qvel[velocity_at : velocity_at + len(velocity)] = velocity
        mujoco.mj_forward(self.model, self.data)

    @property
    def has_figure(self) -> bool:
        """Whether there is a figure, in the physics or only shown."""
        return self.kind in ("physical", "kinematic")

    @property
    def simulates_figure(self) -> bool:
        """Whether the figure is in the physics."""
        return self.kind == "physical"

    @property
    def pose_at(self) -> int:
        """Index of the body's pose in a recorded configuration; if not in the physics, it is appended to qpos."""
        if self.kind not in _FIRST_JOINTS:
            return int(self.model.nq)
        return int(self.model.joint(_FIRST_JOINTS[self.kind]).qposadr[0])

    def full_model(self) -> mujoco.MjModel:
        """The model of recorded configurations: with the figure if there is one, whether in the physics or not."""
        return world_model(self.config) if self.kind == "kinematic" else self.model

    @property
    def ground(self) -> Array:
        """Ground reaction force [N], shape (3,): view of the constraint force on the root's linear degrees of freedom.

        Zero if no figure is in the physics.
        """
        if not self.simulates_figure:
            return np.zeros(3)
        root = int(self.model.joint(FIGURE + "root").dofadr[0])
        return self.data.qfrc_constraint[root : root + 3]

    def warnings(self) -> dict[str, int]:
        """Counts of MuJoCo's warnings since the last reset, by name; empty if there were none."""
        names = [warning.name.removeprefix("mjWARN_").lower() for warning in mujoco.mjtWarning.__members__.values()]
        counts = (int(warning.number) for warning in self.data.warning)
        return {name: count for name, count in zip(names, counts, strict=False) if count}


def place_stylus(
    model: mujoco.MjModel, data: mujoco.MjData, p_H: Array, q_HS: Quaternion | None = None, v_H: Array | None = None
) -> None:
    """Reset a world that holds the Phantom, with the stylus tip at a point of the hand frame [m], shape (3,).

    `q_HS` is the stylus's orientation (wxyz); by default its gimbal joints are at zero. `v_H` is the tip's velocity in
    the hand frame [m/s], shape (3,); by default it is at rest.

    Raises
    ------
    SimError
        If the Phantom cannot reach the point.
    """
    mujoco.mj_resetData(model, data)
    theta = phantom_angles(p_H)
    gimbal = (0.0, 0.0, 0.0) if q_HS is None else gimbal_angles.py_func(theta, q_HS)
    rates = np.zeros(3)
    if v_H is not None:
        rates[:] = np.linalg.solve(jacobian.py_func(theta), vector_to_device_frame.py_func(tuple(v_H)))
    angles = (*linkage_angles.py_func(theta), *gimbal)
    velocities = (*linkage_angles.py_func(rates), 0.0, 0.0, 0.0)
    for name, angle, rate in zip((*LINKAGE_JOINTS, *GIMBAL_JOINTS), angles, velocities, strict=True):
        joint = model.joint(PHANTOM + name)
        data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = angle, rate


@lru_cache(maxsize=8)
def _compiled_models(config: SceneConfig, kind: BodyKind) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    """The compiled models of world and body, cached; every world takes a copy of them."""
    if kind == "robot":
        return robot_world_model(config), arm_model()
    model = world_model(config) if kind == "physical" else device_world_model(config)
    return model, figure_model(config.stature, config.mass)


def phantom_angles(p_H: Array) -> tuple[float, float, float]:
    """Joint angles θ1, θ2, θ3 that put the stylus tip at a point of the hand frame.

    Raises
    ------
    SimError
        If the point is out of reach or beyond a joint's stop; the message has the numbers.
    """
    x, y, z = (float(value) for value in p_H)
    theta1, theta2, theta3, reachable = inverse_kinematics.py_func(vector_to_device_frame.py_func((x, y, z)))
    if not reachable:
        raise SimError(f"the Phantom does not reach ({x:.3f}, {y:.3f}, {z:.3f}) m of the hand frame")
    if not within_limits.py_func((theta1, theta2, theta3)):
        degrees = ", ".join(f"{np.degrees(angle):.0f}°" for angle in (theta1, theta2, theta3))
        raise SimError(
            f"({x:.3f}, {y:.3f}, {z:.3f}) m of the hand frame needs joint angles {degrees}: beyond the Phantom's stops"
        )
    return theta1, theta2, theta3
