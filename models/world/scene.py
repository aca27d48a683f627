"""The MuJoCo world: one model of the Phantom on its table and the figure (or a robot arm) on the floor."""

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from models.errors import ModelError
from models.floor import add_floor
from models.humanoid.skeleton import DEFAULT_MASS, DEFAULT_STATURE, figure_spec
from models.phantom.spec import phantom_spec
from models.robot_arm.spec import arm_spec

PHANTOM = "phantom/"
FIGURE = "figure/"
ROBOT = "robot/"
MAX_SUBSTEPS = 1000  # largest number in a servo period, 1 µs each at 1 kHz; a tick stores a row for each
FIRST_HIDDEN_GROUP = 3  # MuJoCo's convention: geoms of groups 3 to 5 are for collision, not for display
PEDESTAL = 0.45  # height of the robot arm's base [m]
R_WP: npt.NDArray[np.float64] = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from device frame to world: the user faces +x, so right, up and towards the user are −y, z and −x."""
P_WH: npt.NDArray[np.float64] = np.array([0.2, -1.0, 1.0])
"""Origin of the hand frame H in the world [m]; its axes are the world's."""


@dataclass(frozen=True)
class SceneConfig:
    """Parameters of the world.

    Parameters
    ----------
    stature : float
        Stature of the figure [m].
    mass : float
        Mass of the figure [kg].
    servo_period : float
        Time between two servo ticks [s].
    physics_step : float
        Time step of the simulation [s]; divides the servo period.
    """

    stature: float = DEFAULT_STATURE
    mass: float = DEFAULT_MASS
    servo_period: float = 1e-3
    physics_step: float = 1.25e-4

    def substeps(self) -> int:
        """Physics steps in a servo period.

        Raises
        ------
        ModelError
            If either rate is not positive, the step does not divide the period, or divides it into too many.
        """
        if not (0.0 < self.physics_step <= self.servo_period <= 0.1):
            raise ModelError(
                f"servo_period is {self.servo_period} s and physics_step {self.physics_step} s; "
                "expected 0 < physics_step ≤ servo_period ≤ 0.1 s"
            )
        ratio = self.servo_period / self.physics_step
        if ratio > MAX_SUBSTEPS + 0.5:
            raise ModelError(
                f"the physics step {self.physics_step:g} s divides the servo period {self.servo_period:g} s into "
                f"{ratio:.3g} steps; expected at most {MAX_SUBSTEPS}, {self.servo_period / MAX_SUBSTEPS:g} s or more"
            )
        if abs(ratio - round(ratio)) > 1e-6:
            raise ModelError(
                f"the physics step {self.physics_step} s does not divide the servo period {self.servo_period} s "
                f"({ratio:.4g} steps); use for example {self.servo_period / max(1, round(ratio)):.6g} s"
            )
        return round(ratio)


def _add_table(world: mujoco.MjsBody) -> None:
    """Add a table under the Phantom's base; its top is 0.25 m below the origin of H, its centre 0.16 m beyond it."""
    top = (P_WH + np.array([0.16, 0.0, -0.265])).tolist()
    wood = [0.6, 0.48, 0.36, 1.0]
    box = mujoco.mjtGeom.mjGEOM_BOX
    world.add_geom(name="table", type=box, size=[0.3, 0.25, 0.015], pos=top, rgba=wood, contype=0, conaffinity=0)
    height = 0.5 * (top[2] - 0.015)
    for x in (-0.27, 0.27):
        for y in (-0.22, 0.22):
            leg = [top[0] + x, top[1] + y, height]
            world.add_geom(type=box, size=[0.02, 0.02, height], pos=leg, rgba=wood, contype=0, conaffinity=0)


def device_spec(config: SceneConfig) -> mujoco.MjSpec:
    """The world without a figure, before compilation: floor, table and Phantom (prefix ``phantom/``)."""
    spec = mujoco.MjSpec()
    spec.modelname = "haptic vector fields"
    spec.option.timestep = config.servo_period / config.substeps()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.headlight.ambient[:] = 0.35
    spec.visual.headlight.diffuse[:] = 0.4
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.97], rgb2=[0.75, 0.8, 0.86], width=64, height=384,
    )  # fmt: skip
    spec.add_texture(
        name="grid", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.87, 0.88], rgb2=[0.8, 0.81, 0.83], width=256, height=256,
    )  # fmt: skip
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = "grid"
    spec.add_material(name="floor", textures=textures, texrepeat=[1, 1], texuniform=True)
    world = spec.worldbody
    world.add_light(pos=[1.5, -2.0, 4.0], dir=[-0.3, 0.4, -1.0], castshadow=True)
    add_floor(spec, material="floor")
    _add_table(world)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, R_WP.ravel())
    spec.attach(phantom_spec(), prefix=PHANTOM, frame=world.add_frame(pos=P_WH.tolist(), quat=quaternion.tolist()))
    return spec


def world_spec(config: SceneConfig) -> mujoco.MjSpec:
    """The world before compilation: floor, table, Phantom (prefix ``phantom/``) and figure (``figure/``)."""
    spec = device_spec(config)
    spec.attach(figure_spec(config.stature, config.mass), prefix=FIGURE, frame=spec.worldbody.add_frame())
    return spec


def world_model(config: SceneConfig) -> mujoco.MjModel:
    """The compiled world, of 65 degrees of freedom.

    Raises
    ------
    ModelError
        If the rates do not divide, or stature or mass are outside their intervals.
    """
    return world_spec(config).compile()


def device_world_model(config: SceneConfig) -> mujoco.MjModel:
    """The compiled world without a figure; its qpos and qvel are the first parts of those of `world_model`.

    Raises
    ------
    ModelError
        If the rates do not divide.
    """
    return device_spec(config).compile()


def robot_spec(config: SceneConfig) -> mujoco.MjSpec:
    """The world with a robot arm (prefix ``robot/``) on a pedestal in place of the figure, before compilation."""
    spec = device_spec(config)
    height = 0.5 * PEDESTAL
    pedestal = spec.worldbody.add_body(name=ROBOT + "pedestal", pos=[0.0, 0.0, height])
    pedestal.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.16, 0.16, height], rgba=[0.55, 0.57, 0.6, 1.0], contype=0, conaffinity=0
    )
    spec.attach(arm_spec(), prefix=ROBOT, frame=pedestal.add_frame(pos=[0.0, 0.0, height]))
    return spec


def robot_world_model(config: SceneConfig) -> mujoco.MjModel:
    """The compiled world of `robot_spec`.

    Raises
    ------
    ModelError
        If the rates do not divide.
    """
    return robot_spec(config).compile()
