"""Views of the live page are centred in the space beside the panel, and completely visible."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sim.viewer.views import (
    FIELD_OF_VIEW,
    PANEL_WIDTH,
    SHEET_SHARE,
    VIEWS,
    View,
    camera_of,
    is_phone,
    look,
    open_with,
    screen_axes,
)


def projected_points(view: View, width: float, height: float) -> np.ndarray:
    """Pixels of the centre and of the corners of a view's plane, shape (5, 2), from the picture's top left."""
    camera = camera_of(view, width, height)
    forward = camera.look_at - camera.position
    forward /= np.linalg.norm(forward)
    right, up = screen_axes(forward)
    corners = [(0, 0), (-1, -1), (1, -1), (-1, 1), (1, 1)]
    ways = (
        np.array([np.array(view.centre) + i * view.half[0] * right + j * view.half[1] * up for i, j in corners])
        - camera.position
    )
    scale = 0.5 * height / np.tan(0.5 * FIELD_OF_VIEW) / (ways @ forward)
    return np.stack([0.5 * width + scale * (ways @ right), 0.5 * height - scale * (ways @ up)], axis=1)


@pytest.mark.parametrize(
    "size", [(1400, 850), (900, 520), (1920, 1080), (390, 780), (1170, 2340), (700, 900), (600, 1200)]
)
@pytest.mark.parametrize("name", VIEWS)
def test_view_fills_the_space_beside_the_panel(name: str, size: tuple[int, int]) -> None:
    width, height = size
    free = (width, (1.0 - SHEET_SHARE) * height) if is_phone(width, height) else (width - PANEL_WIDTH, height)
    pixels = projected_points(VIEWS[name], *size)
    np.testing.assert_allclose(pixels[0], [0.5 * free[0], 0.5 * free[1]], atol=1e-6)
    inside = (pixels > -1e-6) & (pixels < np.array(free) + 1e-6)
    assert inside.all()
    spread = np.ptp(pixels, axis=0) / free
    assert spread.max() == pytest.approx(1.0)  # as large as possible


def opened_page() -> tuple[Any, Any, Callable[[], None]]:
    """A server, the camera of its browser of 900×520, and a function that reports a change of the camera."""
    calls: dict[str, Callable[..., Any]] = {}
    server: Any = SimpleNamespace(
        initial_camera=SimpleNamespace(), on_client_connect=lambda call: calls.update(connect=call)
    )
    camera: Any = SimpleNamespace(on_update=lambda call: calls.update(update=call))
    resize(camera, 900, 520)
    open_with(server, lambda client: VIEWS["both"])
    calls["connect"](SimpleNamespace(camera=camera))
    return server, camera, lambda: asyncio.run(calls["update"](camera))


def resize(camera: Any, width: int, height: int) -> None:
    camera.image_width, camera.aspect = width, width / height


def test_view_is_fitted_to_resized_windows_until_somebody_turns_it() -> None:
    _, camera, update = opened_page()
    for size in ((1300, 850), (800, 600), (600, 1200), (390, 780)):
        resize(camera, *size)
        update()
        np.testing.assert_allclose(camera.position, camera_of(VIEWS["both"], *size).position)
    look(camera, VIEWS["stage"], (390, 780))  # as by its button
    update()
    resize(camera, 800, 600)
    update()
    fitted = camera.position.copy()
    np.testing.assert_allclose(fitted, camera_of(VIEWS["stage"], 800, 600).position)
    resize(camera, 600, 450)  # viser draws fewer pixels in the same window
    update()
    np.testing.assert_array_equal(camera.position, fitted)
    camera.position = turned = fitted + np.array([0.1, 0.0, 0.0])
    resize(camera, 1300, 850)
    update()
    np.testing.assert_array_equal(camera.position, turned)


def test_late_initial_camera_is_replaced_by_the_fitted_view() -> None:
    server, camera, update = opened_page()
    fitted = camera_of(VIEWS["both"], 900, 520)
    np.testing.assert_allclose(camera.position, fitted.position)
    camera.position = server.initial_camera.position.astype(np.float32)
    update()
    np.testing.assert_allclose(camera.position, fitted.position)
    np.testing.assert_allclose(camera.look_at, fitted.look_at)
    camera.position = turned = fitted.position + np.array([0.1, 0.0, 0.0])
    update()
    np.testing.assert_array_equal(camera.position, turned)
