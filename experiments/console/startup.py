"""Start time of the program and settings of the environment that must be made before NumPy and MuJoCo are imported."""

import os
import signal
import sys
import time
from contextlib import suppress
from ctypes.util import find_library

for _stream in range(3):  # a file that is opened later would take the place of a closed stream, and get what is printed
    try:
        os.fstat(_stream)
    except OSError:
        os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
sys.stdout, sys.stderr = sys.stdout or open(os.devnull, "w"), sys.stderr or open(os.devnull, "w")  # noqa: SIM115
sys.stdin = sys.stdin or open(os.devnull)  # noqa: SIM115


def stop_early(*_: object) -> None:
    """Handle an interrupt while the program is still importing, where an exception would end in a traceback."""
    os.write(2, b"hvf: stopped; no partial files are left\n")
    os._exit(130)


# Not if the shell ignores the signal, nor in a worker process of this program, which imports this module late.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler and "multiprocessing" not in sys.modules:
    with suppress(ValueError):  # raised in any thread but the main one
        signal.signal(signal.SIGINT, stop_early)
STARTED = time.perf_counter()
"""Start of the program on `time.perf_counter` [s], from which the time to the first tick is measured."""
# The matrices are small, so that BLAS threads only slow each other down. NumPy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
_BACKENDS = {"", "0", "1", "cgl", "disable", "egl", "enable", "false", "glfw", "off", "on", "osmesa", "true", "wgl"}
_BACKEND_LIBRARIES = {"egl": ("EGL", "libegl1 libgl1-mesa-dri"), "osmesa": ("OSMesa", "libosmesa6")}
# MuJoCo fails to import with other values or without the library; rendering chooses its own backend
# (`experiments.render.graphics`).
_requested_backend = os.environ.get("MUJOCO_GL", "").lower().strip()
_library, _package = _BACKEND_LIBRARIES.get(_requested_backend, ("", ""))
if _requested_backend not in _BACKENDS:
    print(f"MUJOCO_GL is {os.environ.pop('MUJOCO_GL')!r}, which MuJoCo does not know: ignored", file=sys.stderr)
elif _library and find_library(_library) is None:
    print(
        f"MUJOCO_GL is {os.environ.pop('MUJOCO_GL')!r}, and lib{_library} is not on this machine: ignored; "
        f"unset it, or apt-get install {_package}",
        file=sys.stderr,
    )
