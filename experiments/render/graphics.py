"""Off-screen rendering: detection of the machine's OpenGL backend, and a canvas on which MuJoCo draws with it."""

import os
import subprocess
import sys
from importlib import import_module
from typing import Any, NamedTuple, Self

import mujoco
import numpy as np
import numpy.typing as npt

from sim.errors import SimError

Image = npt.NDArray[np.uint8]

OFFSCREEN = ("egl", "osmesa")  # EGL uses a graphics card or Mesa's software renderer, OSMesa only the latter
INSTALL = "apt-get install libegl1 libgl1-mesa-dri, or libosmesa6"
_TIMEOUT = 60.0  # [s] for the trial of a backend
_TRIAL = """
import mujoco, sys
from importlib import import_module
context = import_module("mujoco." + sys.argv[1]).GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_100)
print("drawn")
sys.stdout.flush()
import os; os._exit(0)
"""


SUN = (38.0, -52.0)  # direction of the sunlight: azimuth relative to that of the view, elevation [degrees]
SUN_DISTANCE = 5.0  # distance of the sun's shadow map from the point that is looked at [m]


class NoGraphics(SimError):
    """Raised on a machine that cannot render off-screen."""


def offscreen_backend() -> str:
    """The first working backend of `OFFSCREEN`, each tried in its own process; `MUJOCO_GL` names the only one to try.

    Raises
    ------
    NoGraphics
        If none works; the message says what to install.
    """
    requested = os.environ.get("MUJOCO_GL", "").lower().strip()
    candidates = (requested,) if requested in OFFSCREEN else OFFSCREEN
    failures: list[str] = []
    for name in candidates:
        failure = _backend_failure(name)
        if not failure:
            return name
        failures.append(f"{name}: {failure}")
    raise NoGraphics(f"nothing can be drawn on this machine ({'; '.join(failures)}); expected EGL or OSMesa: {INSTALL}")


def _backend_failure(backend: str) -> str:
    """Reason why a backend fails, in a few words; empty if it works."""
    try:
        result = subprocess.run(
            [sys.executable, "-c", _TRIAL, backend], capture_output=True, text=True, timeout=_TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"no answer in {_TIMEOUT:g} s"
    if "drawn" in result.stdout:
        return ""
    lines = result.stderr.strip().splitlines()
    return lines[-1][:120] if lines else f"exit code {result.returncode}"


class View(NamedTuple):
    """Camera pose: target in W and distance from it [m], azimuth from +x to +y and elevation upwards [degrees]."""

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float

    def camera(self) -> mujoco.MjvCamera:
        """The view as a MuJoCo camera."""
        camera = mujoco.MjvCamera()
        camera.lookat[:], camera.distance = self.lookat, self.distance
        camera.azimuth, camera.elevation = self.azimuth, self.elevation
        return camera

    def direction(self, azimuth: float, elevation: float) -> npt.NDArray[np.float64]:
        """Unit vector at an azimuth relative to the view's, and an elevation [degrees]."""
        a, e = np.deg2rad(self.azimuth + azimuth), np.deg2rad(elevation)
        return np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


class Canvas:
    """Renders pictures of a world.

    Parameters
    ----------
    model : mujoco.MjModel
        The world; its ``vis.global_`` sets the largest size of a picture.
    backend : str
        Result of `offscreen_backend`.
    most_geoms : int
        Largest number of geoms in a picture.
    reach : float, optional
        Half width of the region that casts shadows [m], by default the world's; the smaller, the sharper the shadows.
    """

    def __init__(self, model: mujoco.MjModel, backend: str, most_geoms: int = 2000, reach: float | None = None):
        model.stat.extent = model.stat.extent if reach is None else reach
        size = model.vis.global_
        self._gl: Any = import_module(f"mujoco.{backend}").GLContext(size.offwidth, size.offheight)
        self._gl.make_current()
        self._context: mujoco.MjrContext = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._model, self._option, self._perturbation = model, mujoco.MjvOption(), mujoco.MjvPerturb()
        self.scene = mujoco.MjvScene(model, most_geoms)

    def look(self, data: mujoco.MjData, view: "View", group: int) -> None:
        """Start a scene with the geoms of a group in the world's current state, seen from a view."""
        self._option.geomgroup[:] = 0
        self._option.geomgroup[group] = 1
        mujoco.mjv_updateScene(
            self._model, data, self._option, self._perturbation, view.camera(), mujoco.mjtCatBit.mjCAT_ALL, self.scene
        )
        # The sun is behind the left shoulder of the viewer, so that the visible sides are lit.
        for light in self.scene.lights[: self.scene.nlight]:
            if light.castshadow:
                light.dir[:] = view.direction(*SUN)
                light.pos[:] = np.asarray(view.lookat) - SUN_DISTANCE * light.dir

    def add(self, data: mujoco.MjData) -> None:
        """Add the moving geoms in the world's current state to the scene."""
        mujoco.mjv_addGeoms(
            self._model, data, self._option, self._perturbation, mujoco.mjtCatBit.mjCAT_DYNAMIC, self.scene
        )

    def connect(
        self, kind: mujoco.mjtGeom, start: npt.ArrayLike, end: npt.ArrayLike, width: float, color: tuple[float, ...]
    ) -> None:
        """Add a rod or an arrow between two points in W to the scene."""
        geom = self.scene.geoms[self.scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.array(color, dtype=np.float32))
        mujoco.mjv_connector(geom, kind, width, np.asarray(start, dtype=float), np.asarray(end, dtype=float))
        self.scene.ngeom += 1

    def picture(self, width: int, height: int) -> Image:
        """Render the scene, shape (height, width, 3)."""
        rectangle, rows = mujoco.MjrRect(0, 0, width, height), np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_render(rectangle, self.scene, self._context)
        mujoco.mjr_readPixels(rows, None, rectangle, self._context)  # pyright: ignore[reportArgumentType]
        return rows[::-1]

    def close(self) -> None:
        """Release the graphics buffers."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
