"""The floor on which figures stand, and MuJoCo's contact parameters for it."""

import mujoco

from geometry.physics import FRICTION

_TORSIONAL_FRICTION, _ROLLING_FRICTION = 0.005, 0.0001  # [m], MuJoCo's defaults; contacts with condim 3 do not use them

# MuJoCo's impratio: ratio of frictional to normal constraint impedance. Contacts are soft: with a ratio of 1, a loaded
# point creeps over the floor by some centimetres a second, although its force is well within the friction cone.
_IMPEDANCE_RATIO = 10.0


def add_floor(spec: mujoco.MjSpec, material: str = "") -> None:
    """Add the plane z = 0, named ``floor``, with the friction law that the figure's controller assumes.

    The law is Coulomb's, ‖f_t‖ ≤ μ f_n, an elliptic cone. (MuJoCo's default is a pyramid, with a friction along the
    diagonals of 1/√2 of that along the axes.)
    """
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _IMPEDANCE_RATIO
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], material=material,
        contype=1, conaffinity=0, condim=3, friction=[FRICTION, _TORSIONAL_FRICTION, _ROLLING_FRICTION],
    )  # fmt: skip
