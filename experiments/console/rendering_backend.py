"""Drops a ``MUJOCO_GL`` with which MuJoCo fails to import, or whose library is missing, and says so.

Rendering chooses its own backend (`experiments.render.graphics`).
"""

import os
import sys

_BACKENDS = {"", "0", "1", "cgl", "disable", "egl", "enable", "false", "glfw", "off", "on", "osmesa", "true", "wgl"}
_BACKEND_LIBRARIES = {"egl": ("EGL", "libegl1 libgl1-mesa-dri"), "osmesa": ("OSMesa", "libosmesa6")}


def _is_missing(library: str) -> bool:
    from ctypes.util import find_library  # takes long to import, and is rarely needed

    return find_library(library) is None


_requested_backend = os.environ.get("MUJOCO_GL", "").lower().strip()
_library, _package = _BACKEND_LIBRARIES.get(_requested_backend, ("", ""))
if _requested_backend not in _BACKENDS:
    print(f"MUJOCO_GL is {os.environ.pop('MUJOCO_GL')!r}, which MuJoCo does not know: ignored", file=sys.stderr)
elif _library and _is_missing(_library):
    print(
        f"MUJOCO_GL is {os.environ.pop('MUJOCO_GL')!r}, and lib{_library} is not on this machine: ignored; "
        f"unset it, or apt-get install {_package}",
        file=sys.stderr,
    )
