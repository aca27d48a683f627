import mujoco
import numpy as np

from models.humanoid.skeleton import N_TANGENT
from models.world.scene import FIGURE
from sim.body.mass_matrix import inertia, inertial_force, mass_matrix
from sim.world.world import World


def test_mass_matrix_and_inertial_force_equal_mujoco_bit_for_bit():
    world, random = World(), np.random.default_rng(3)
    world.data.qpos += 0.3 * random.normal(size=world.model.nq)
    mujoco.mj_normalizeQuat(world.model, world.data.qpos)
    mujoco.mj_forward(world.model, world.data)
    first = int(world.model.joint(FIGURE + "root").dofadr[0])
    dofs = slice(first, first + N_TANGENT)
    mass = mass_matrix(world.model, world.data, dofs)
    whole = np.zeros((world.model.nv, world.model.nv))
    mujoco.mj_fullM(world.model, world.data, whole)
    M, a = whole[dofs, dofs], random.normal(size=N_TANGENT)
    assert not whole[dofs, : dofs.start].any()
    for i in range(N_TANGENT):
        assert [inertia.py_func(mass, i, k) for k in range(N_TANGENT)] == M[i].tolist()
        dense = 0.25
        for k in range(N_TANGENT):
            dense += M[i, k] * a[k]
        assert inertial_force.py_func(mass, i, a, 0.25) == dense
