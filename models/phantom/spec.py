"""The Phantom as a MuJoCo model: geometry and loop closure from ``phantom.xml``, parameters from `PREMIUM_1_5`."""

from importlib.resources import files

import mujoco
import numpy as np

from geometry.vectors import Triple, Vector
from models.phantom.parameters import PREMIUM_1_5, Pair

MOTOR_JOINTS = ("theta1", "theta2", "theta3")
LINKAGE_JOINTS = (*MOTOR_JOINTS, "elbow", "twin")  # motors, and joints that close the loop: see `linkage_angles`
GIMBAL_JOINTS = ("gimbal1", "gimbal2", "gimbal3")
MOTORS = ("motor1", "motor2", "motor3")

_NEGLIGIBLE_INERTIA = 1e-14  # MuJoCo requires every moving body to have a mass and inertia [kg], [kg m²]


def _set_inertia(spec: mujoco.MjSpec, body: str, mass: float, com: Vector, about_com: Triple) -> None:
    item = spec.body(body)
    item.explicitinertial = True
    item.mass, item.ipos, item.inertia = mass, np.array(com), np.array(about_com)


def _set_range(spec: mujoco.MjSpec, joint: str, limit: Pair) -> None:
    item = spec.joint(joint)
    item.limited, item.range = mujoco.mjtLimited.mjLIMITED_TRUE, np.array(limit)


def phantom_spec() -> mujoco.MjSpec:
    """The Premium 1.5 as an editable MuJoCo model, to be attached into a world.

    Its base body is the device frame P (y up): the world rotates it so that P's y axis points against gravity. The
    reflected inertia of the rotors is subtracted from the published inertias of turret, be and df and added to the
    joints as armature: M remains exactly as published, and the remaining inertias of the bars obey the triangle
    inequality. The gimbal is massless, as in the published model; its joints have the stylus's inertia as armature.

    Returns
    -------
    mujoco.MjSpec
        Joints theta1..3 (motors), elbow, twin (loop closed by equality constraints), gimbal1..3; torque motors
        motor1..3 [N m at the joint]; site tip at the gimbal centre, with the axes of the stylus.
    """
    p = PREMIUM_1_5
    spec = mujoco.MjSpec.from_string(files("models.phantom").joinpath("phantom.xml").read_text(encoding="utf-8"))
    rotor = p.armature
    base_yy = p.inertia_base_yy - rotor[0]
    # The turret rotates about y only: its mass and its other two moments of inertia have no effect.
    _set_inertia(spec, "turret", 0.5, (0.0, 0.0, 0.0), (base_yy, base_yy, base_yy))
    steiner_be, steiner_df = p.m_be * p.l5**2, p.m_df * p.l6**2
    be, df = p.inertia_be, p.inertia_df
    _set_inertia(spec, "be", p.m_be, (0.0, 0.0, p.l5), (be[0] - rotor[1] - steiner_be, be[1] - steiner_be, be[2]))
    _set_inertia(spec, "df", p.m_df, (0.0, p.l6, 0.0), (df[0] - rotor[2] - steiner_df, df[1], df[2] - steiner_df))
    _set_inertia(spec, "a", p.m_a, (0.0, -0.5 * p.l2, 0.0), p.inertia_a)
    _set_inertia(spec, "c", p.m_c, (0.0, 0.0, 0.5 * p.l1), p.inertia_c)
    for body in ("yoke", "fork", "stylus"):
        _set_inertia(
            spec,
            body,
            _NEGLIGIBLE_INERTIA,
            (0.0, 0.0, 0.0),
            (_NEGLIGIBLE_INERTIA, _NEGLIGIBLE_INERTIA, _NEGLIGIBLE_INERTIA),
        )
    for axis, (joint, motor) in enumerate(zip(MOTOR_JOINTS, MOTORS, strict=True)):
        item = spec.joint(joint)
        item.armature, item.frictionloss = rotor[axis], p.coulomb_friction[axis]
        item.damping = np.array([p.viscous_friction[axis], 0.0, 0.0])
        _set_range(spec, joint, p.limit[axis])
        peak = p.peak_torque[axis]
        spec.add_actuator(
            name=motor, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, gear=[1, 0, 0, 0, 0, 0],
            ctrllimited=True, ctrlrange=(-peak, peak),
        )  # fmt: skip
    _set_range(spec, "elbow", p.elbow_limit)
    for axis, joint in enumerate(GIMBAL_JOINTS):
        item = spec.joint(joint)
        item.armature, item.damping = p.gimbal_inertia[axis], np.array([p.gimbal_damping, 0.0, 0.0])
        _set_range(spec, joint, p.gimbal_limit[axis])
    return spec
