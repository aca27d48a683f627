"""The lowest visible point of a body, against the vertices of fine meshes of its geoms."""

import mujoco
import numpy as np
import pytest
import trimesh
from mjviser.conversions import create_primitive_mesh

from experiments.render.scenes import lowest_point, seen_geoms
from models.humanoid.skeleton import N_POSE, rest_pose
from models.world.scene import FIGURE, SceneConfig, world_model

_GEOMS = {
    "sphere": "<geom type='sphere' size='.2'/>",
    "capsule": "<geom type='capsule' size='.1 .3'/>",
    "ellipsoid": "<geom type='ellipsoid' size='.1 .2 .35'/>",
    "box": "<geom type='box' size='.1 .2 .3'/>",
    "cylinder": "<geom type='cylinder' size='.1 .3'/>",
    "mesh": "<geom type='mesh' mesh='wedge'/>",
}
_FLOOR = "<geom name='floor' type='plane' size='9 9 1'/>"
_WEDGE = "<mesh name='wedge' vertex='0 0 0  1 0 0  0 1 0  0 0 2'/>"


@pytest.mark.parametrize("kind", _GEOMS)
@pytest.mark.parametrize("seed", range(3))
def test_lowest_point_matches_the_surface_at_any_orientation(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, p = rng.normal(size=4), rng.normal(size=3)
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{_WEDGE}</asset>"
        f"<worldbody>{_FLOOR}<body name='b'><freejoint/>{_GEOMS[kind]}</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[:3], data.qpos[3:7] = p, q / np.linalg.norm(q)
    mujoco.mj_kinematics(model, data)
    if kind == "mesh":
        vertices, expected_error = model.mesh_vert.astype(float), 1e-6
    else:
        mesh: trimesh.Trimesh = create_primitive_mesh(model, 1)
        while len(mesh.vertices) < 3000 and kind not in ("box", "cylinder"):
            mesh = mesh.subdivide()
        vertices, expected_error = np.asarray(mesh.vertices), 0.02
    surface = data.geom_xpos[1] + vertices @ data.geom_xmat[1].reshape(3, 3).T
    found = lowest_point(model, data, seen_geoms(model, "b"))
    assert found <= surface[:, 2].min() + 1e-6
    assert found == pytest.approx(surface[:, 2].min(), abs=expected_error)


def test_lowest_point_of_figure_at_rest_ignores_contact_spheres() -> None:
    model = world_model(SceneConfig())
    data = mujoco.MjData(model)
    root = int(model.joint(FIGURE + "root").qposadr[0])
    data.qpos[root : root + N_POSE] = rest_pose()
    mujoco.mj_kinematics(model, data)
    assert lowest_point(model, data, seen_geoms(model, FIGURE)) == pytest.approx(0.0, abs=1e-3)
    assert len(seen_geoms(model, FIGURE + "left_foot")) == 3
