"""Rendering of the Phantom to a PNG: ``python -m models.phantom.picture OUT.png`` (headless: ``MUJOCO_GL=egl``)."""

import sys

import matplotlib.image
import mujoco
import numpy as np

from models.phantom.kinematics import R_HP, linkage_angles
from models.phantom.spec import GIMBAL_JOINTS, LINKAGE_JOINTS, phantom_spec

WIDTH, HEIGHT = 960, 720  # [pixels]


def render(path: str, theta: tuple[float, float, float], gimbal: tuple[float, float, float]) -> None:
    """Draw the device at given joint and gimbal angles [rad] into a PNG file."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = WIDTH, HEIGHT
    spec.visual.headlight.ambient = np.full(3, 0.4)
    spec.visual.headlight.diffuse = np.full(3, 0.35)
    spec.visual.quality.shadowsize = 4096
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[1, 1, 1], rgb2=[1, 1, 1], width=32, height=192,
    )  # fmt: skip
    world = spec.worldbody
    world.add_light(pos=[-0.5, 0.6, 1.4], dir=[0.45, -0.4, -1.0])
    table = mujoco.mjtGeom.mjGEOM_BOX
    world.add_geom(type=table, size=[0.36, 0.28, 0.01], pos=[0.12, 0.0, -0.26], rgba=[0.86, 0.84, 0.8, 1])
    q_HP = np.empty(4)
    mujoco.mju_mat2Quat(q_HP, np.array(R_HP).ravel())
    spec.attach(phantom_spec(), prefix="phantom/", frame=world.add_frame(quat=q_HP.tolist()))
    model = spec.compile()
    data = mujoco.MjData(model)
    angles = (*linkage_angles.py_func(theta), *gimbal)
    for name, angle in zip((*LINKAGE_JOINTS, *GIMBAL_JOINTS), angles, strict=True):
        data.joint(f"phantom/{name}").qpos[0] = angle
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = 0.08, 0.0, -0.01
    camera.distance, camera.azimuth, camera.elevation = 0.78, 72.0, -14.0
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera)
        matplotlib.image.imsave(path, renderer.render())


if __name__ == "__main__":
    render(sys.argv[1], (0.2, 0.3, 0.35), (0.1, 0.15, 0.0))
