"""Floor contacts: a circular Coulomb friction cone, with little creep inside it."""

import mujoco
import numpy as np
import pytest

from geometry.physics import FRICTION
from models.floor import add_floor

MASS, RADIUS = 10.0, 0.02


def sliding_distance(force_share: float, direction: float, duration: float = 1.0) -> float:
    """Distance that a force of a share of μ m g in a direction pushes a block over the floor [m]."""
    spec = mujoco.MjSpec()
    add_floor(spec)
    body = spec.worldbody.add_body(name="block", pos=[0.0, 0.0, RADIUS])
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=MASS, friction=[FRICTION, 0.005, 1e-4])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    start = data.qpos[:2].copy()
    force = force_share * FRICTION * MASS * float(np.linalg.norm(model.opt.gravity))
    data.qfrc_applied[:2] = force * np.cos(direction), force * np.sin(direction)
    mujoco.mj_step(model, data, round(duration / model.opt.timestep))
    return float(np.linalg.norm(data.qpos[:2] - start))


@pytest.mark.parametrize("direction", [0.0, 0.3, 0.25 * np.pi])
def test_block_creeps_millimetres_below_the_friction_limit_and_slides_above_it(direction: float) -> None:
    assert sliding_distance(0.9, direction) < 0.004
    # From rest: (1.1 − 1) μ g t²/2.
    assert sliding_distance(1.1, direction) == pytest.approx(0.5 * 0.1 * FRICTION * 9.81, rel=0.1)
