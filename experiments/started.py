"""When the program began, for the time until a first tick. Imported first."""

import os
import sys
import time

STARTED = time.perf_counter()
"""[s], of `time.perf_counter`."""
# The matrices here are small: more threads only get into each other's way. Read by NumPy when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
_GRAPHICS = {"", "0", "1", "cgl", "disable", "egl", "enable", "false", "glfw", "off", "on", "osmesa", "true", "wgl"}
# MuJoCo cannot be imported with any other; pictures look for themselves what draws (`experiments.render.graphics`).
if os.environ.get("MUJOCO_GL", "").lower().strip() not in _GRAPHICS:
    print(f"MUJOCO_GL is {os.environ.pop('MUJOCO_GL')!r}, which MuJoCo does not know: left out", file=sys.stderr)
