"""MuJoCo's C functions, callable from compiled code by symbol.

``numba.types.ExternalFunction`` refers to a function by name, so a loop that calls it can be cached on disk and is
valid in the next process; an address in a global would prevent that. Models and data are passed as addresses
(``MjModel._address``, ``MjData._address``); arrays as ``array.ctypes``. The signatures are those of mujoco.h.
"""

from pathlib import Path

import llvmlite.binding as llvm
import mujoco
from numba import types

from sim.errors import SimError

_address = types.uintp
_double = types.CPointer(types.float64)
_void = types.void


def _load_library() -> None:
    """Make the symbols of the libmujoco in the mujoco package known to the just-in-time linker."""
    folder = Path(mujoco.__file__).parent
    libraries = sorted(
        path for pattern in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll") for path in folder.glob(pattern)
    )
    if not libraries:
        raise SimError(f"no MuJoCo library in {folder}; reinstall the mujoco package")
    llvm.load_library_permanently(str(libraries[0]))


_load_library()

mj_step = types.ExternalFunction("mj_step", _void(_address, _address))
"""mj_step(m, d): advance one physics step."""

mj_kinematics = types.ExternalFunction("mj_kinematics", _void(_address, _address))
"""mj_kinematics(m, d): positions of bodies, geoms and sites."""

mj_full_m = types.ExternalFunction("mj_fullM", _void(_address, _address, _double))
"""mj_fullM(m, d, M): dense mass matrix, shape (nv, nv)."""

mj_differentiate_pos = types.ExternalFunction(
    "mj_differentiatePos", _void(_address, _double, types.float64, _double, _double)
)
"""mj_differentiatePos(m, dv, dt, q1, q2): the velocity that carries q1 to q2 in dt."""

mj_integrate_pos = types.ExternalFunction("mj_integratePos", _void(_address, _double, _double, types.float64))
"""mj_integratePos(m, q, v, dt): move q along v for dt, in place."""
