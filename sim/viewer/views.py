"""Camera views of a live page; a view fills the part of the window that the panel leaves free."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import viser

from geometry.arrays import Array

FIELD_OF_VIEW = np.deg2rad(34.0)  # vertical [rad]: a ball at the upper edge is drawn 1/cos 17°, 5 % longer than wide
PANEL_WIDTH = 335.0  # [px] width of viser's panel
MAX_PHONE_RATIO = 0.75  # width/height below which a window counts as a phone's, where the panel covers the lower part
DESKTOP_WIDTHS = 576.0, 720.0  # [px] a tall window between these is no phone's: below the first viser covers the lower
# part, and phones, whose pixels are finer, report more than the second
LEAST_FREE = 0.3  # smallest share of the width beside the panel: reached by windows below 479 px other than a phone's
SHEET_SHARE = 0.6  # share of the height that the panel covers on a phone
DEFAULT_SIZE = 1400.0, 850.0  # [px] assumed size of a window that has not reported its own


class View(NamedTuple):
    """Centre of the region that is viewed, half its width and height [m], and a vector to the camera."""

    centre: tuple[float, float, float]
    half: tuple[float, float]
    side: tuple[float, float, float]


class Camera(NamedTuple):
    """Position of a camera, and the point in the middle of its picture [m], shapes (3,)."""

    position: Array
    look_at: Array


VIEWS = {
    "both": View((0.72, -0.2, 1.02), (1.8, 1.2), (0.08, -1.0, 0.4)),
    "workspace": View((1.65, -0.6, 1.25), (0.8, 0.55), (0.0, -1.0, 0.4)),
    "stage": View((-0.3, 0.2, 0.98), (1.0, 1.25), (0.15, -1.0, 0.25)),
}


def camera_of(view: View, width: float, height: float) -> Camera:
    r"""The camera that shows a view in a window of a given size [px].

    With m metres per pixel in the plane of the view's centre, window height h and field of view α, its distance is
    m h/(2 tan(α/2)). It is shifted by half the part that the panel covers, so that the view is centred in the rest.
    """
    beside = max(width - PANEL_WIDTH, LEAST_FREE * width), height
    free = (width, (1.0 - SHEET_SHARE) * height) if is_phone(width, height) else beside
    metres = max(2.0 * half / pixels for half, pixels in zip(view.half, free, strict=True))
    side = np.array(view.side) / np.linalg.norm(view.side)
    right, up = screen_axes(-side)
    middle = np.array(view.centre) + 0.5 * metres * ((width - free[0]) * right - (height - free[1]) * up)
    return Camera(middle + 0.5 * metres * height / np.tan(0.5 * FIELD_OF_VIEW) * side, middle)


def screen_axes(forward: Array) -> tuple[Array, Array]:
    """Unit vectors to the right and up on the screen of a camera that looks along a unit vector, shapes (3,)."""
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward)


def add_view_buttons(gui: viser.GuiApi) -> None:
    """Add buttons that show one of `VIEWS` in the browser in which they are pressed."""
    views = gui.add_button_group("Look at", tuple(VIEWS))

    @views.on_click
    def _(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        if event.client is not None:
            look_from(event.client, VIEWS[views.value])


def look(camera: viser.CameraHandle | viser.InitialCameraConfig, view: View, size: tuple[float, float]) -> None:
    """Place a camera such that it shows a view in a window of a given size (width, height) [px]."""
    placement = camera_of(view, *size)
    camera.position, camera.look_at, camera.fov = placement.position, placement.look_at, FIELD_OF_VIEW


def look_from(client: viser.ClientHandle, view: View) -> None:
    """Show a view in a client's browser."""
    look(client.camera, view, window_of(client.camera))


def window_of(camera: viser.CameraHandle) -> tuple[float, float]:
    """Width and height of a browser's window [px], the width at most the default one.

    The browser reports physical pixels, of which a high-resolution screen has two or three per CSS pixel.
    """
    width = min(float(camera.image_width), DEFAULT_SIZE[0])
    return width, width / camera.aspect


def open_with(server: viser.ViserServer, view_of: Callable[[viser.ClientHandle], View]) -> None:
    """Show a view to each new browser, and again when its view is reset or its window changes shape.

    A view that a user has turned or moved is kept when the window changes.

    A browser may apply the server's initial camera after the one that it is sent on connecting (viser 1.1 applies the
    former in an effect of its page, the latter when its message arrives), so the view is sent again to a browser that
    reports the initial camera.
    """
    look(server.initial_camera, VIEWS["both"], DEFAULT_SIZE)
    initial = server.initial_camera.position

    def place_camera(client: viser.ClientHandle) -> None:
        look_from(client, view_of(client))
        sizes = deque([window_of(client.camera)], maxlen=32)

        @client.camera.on_update
        async def _(camera: viser.CameraHandle) -> None:  # asynchronous, so that updates are handled in order
            size, before = window_of(camera), sizes[-1]
            if size != before:
                sizes.append(size)
            if np.allclose(camera.position, initial, atol=1e-4):
                look_from(client, view_of(client))
            elif _is_resized(before, size):
                view = next((view for view in VIEWS.values() if _is_placed_for(camera, view, sizes)), None)
                if view is not None:
                    look(camera, view, size)

    server.on_client_connect(place_camera)


def _is_resized(before: tuple[float, float], size: tuple[float, float]) -> bool:
    """Whether a window was resized, not just drawn at another resolution: viser goes down to 3/4 if it is slow."""
    share = size[0] / before[0]
    return abs(share - size[1] / before[1]) > 0.01 * share or not 0.74 < share < 1.36


def _is_placed_for(camera: viser.CameraHandle, view: View, sizes: Iterable[tuple[float, float]]) -> bool:
    """Whether a camera is where a view places it in a window of one of the given sizes."""
    return any(np.allclose(camera.position, camera_of(view, *size).position, atol=1e-3) for size in sizes)


def is_phone(width: float, height: float) -> bool:
    """Whether a window of a given size [px] is as narrow as a phone's."""
    return width < MAX_PHONE_RATIO * height and not DESKTOP_WIDTHS[0] < width < DESKTOP_WIDTHS[1]
