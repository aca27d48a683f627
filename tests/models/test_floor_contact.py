"""The floor: contacts obey the round cone of Coulomb's law and do not creep within it."""

import mujoco
import numpy as np
import pytest

from models.floor import FRICTION, add_floor

MASS, RADIUS = 10.0, 0.02


def slid(share: float, way: float, seconds: float = 1.0) -> float:
    """How far a sliding block is pushed over the floor by a share of μ m g in a direction [m]."""
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
    force = share * FRICTION * MASS * float(np.linalg.norm(model.opt.gravity))
    data.qfrc_applied[:2] = force * np.cos(way), force * np.sin(way)
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return float(np.linalg.norm(data.qpos[:2] - start))


@pytest.mark.parametrize("way", [0.0, 0.3, 0.25 * np.pi])
def test_a_point_pushed_by_less_than_friction_holds_creeps_by_millimetres_and_by_more_it_goes(way: float) -> None:
    assert slid(0.9, way) < 0.004
    # From rest: (1.1 − 1) μ g t²/2.
    assert slid(1.1, way) == pytest.approx(0.5 * 0.1 * FRICTION * 9.81, rel=0.1)
