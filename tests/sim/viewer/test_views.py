"""A view of the live page is in the middle of what the panel leaves free, and all of it is there."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sim.viewer.views import FIELD_OF_VIEW, PANEL, PHONE, SHEET, VIEWS, View, camera_of, open_with, screen_axes


def seen(view: View, width: float, height: float) -> np.ndarray:
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


@pytest.mark.parametrize("size", [(1400, 850), (900, 520), (1920, 1080), (390, 780), (700, 900)])
@pytest.mark.parametrize("name", VIEWS)
def test_a_view_fills_what_the_panel_leaves_free(name: str, size: tuple[int, int]) -> None:
    width, height = size
    free = (width, (1.0 - SHEET) * height) if width < PHONE * height else (width - PANEL, height)
    pixels = seen(VIEWS[name], *size)
    np.testing.assert_allclose(pixels[0], [0.5 * free[0], 0.5 * free[1]], atol=1e-6)
    inside = (pixels > -1e-6) & (pixels < np.array(free) + 1e-6)
    assert inside.all()
    spread = np.ptp(pixels, axis=0) / free
    assert spread.max() == pytest.approx(1.0)  # no smaller than it has to be


def test_a_browser_that_applies_the_initial_camera_late_is_shown_its_view_again() -> None:
    calls: dict[str, Callable[..., None]] = {}
    server: Any = SimpleNamespace(
        initial_camera=SimpleNamespace(), on_client_connect=lambda call: calls.update(connect=call)
    )
    camera = SimpleNamespace(image_width=900, aspect=900 / 520, on_update=lambda call: calls.update(update=call))
    open_with(server, lambda client: VIEWS["both"])
    calls["connect"](SimpleNamespace(camera=camera))
    fitted = camera_of(VIEWS["both"], 900, 520)
    np.testing.assert_allclose(camera.position, fitted.position)
    camera.position = server.initial_camera.position.astype(np.float32)
    calls["update"](camera)
    np.testing.assert_allclose(camera.position, fitted.position)
    np.testing.assert_allclose(camera.look_at, fitted.look_at)
    camera.position = turned = fitted.position + np.array([0.1, 0.0, 0.0])
    calls["update"](camera)
    np.testing.assert_array_equal(camera.position, turned)
