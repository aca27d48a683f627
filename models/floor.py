"""The floor on which figures stand, and how MuJoCo solves their contacts with it."""

import mujoco

FRICTION = 0.9  # μ of a sole on the floor
_TORSION, _ROLLING = 0.005, 0.0001  # [m], MuJoCo's own, which contacts of three dimensions do not use

# Times by which friction is harder than what carries. MuJoCo's contacts are soft: at 1 a loaded point creeps over the
# floor by some centimetres a second, well within its friction.
_HARDNESS = 10.0


def add_floor(spec: mujoco.MjSpec, material: str = "") -> None:
    """Add the plane z = 0, named ``floor``, and have contacts obey the law that the figure plans with.

    The law is Coulomb's, ‖f_t‖ ≤ μ f_n: a round cone (MuJoCo's default is a pyramid, on which friction along the
    diagonals is 1/√2 of that along the axes).
    """
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _HARDNESS
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], material=material,
        contype=1, conaffinity=0, condim=3, friction=[FRICTION, _TORSION, _ROLLING],
    )  # fmt: skip
