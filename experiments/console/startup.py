"""Start time of the program and settings of the environment that must be made before NumPy and MuJoCo are imported."""

import os
import sys
import time

STARTED = time.perf_counter()
"""Start of the program on `time.perf_counter` [s], from which the time to the first tick is measured."""
# The matrices are small, so that BLAS threads only slow each other down. NumPy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
_GRAPHICS = {"", "0", "1", "cgl", "disable", "egl", "enable", "false", "glfw", "off", "on", "osmesa", "true", "wgl"}
# MuJoCo fails to import with any other value; rendering chooses its own backend (`experiments.render.graphics`).
if os.environ.get("MUJOCO_GL", "").lower().strip() not in _GRAPHICS:
    print(f"MUJOCO_GL is {os.environ.pop('MUJOCO_GL')!r}, which MuJoCo does not know: left out", file=sys.stderr)
