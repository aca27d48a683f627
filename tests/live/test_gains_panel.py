"""The gains panel: sliders show the gains, and numbers out of range are refused with their bounds."""

from types import SimpleNamespace
from typing import Any

import pytest

from controllers.errors import ParameterError
from experiments.config.options import run_config
from experiments.live.panels import gains_panel
from experiments.live.panels.gains_panel import GainsPanel
from experiments.live.session.gains import with_gain


class Gui:
    """A GUI without a browser."""

    def __init__(self) -> None:
        self.sliders: dict[str, Any] = {}

    def add_html(self, content: str) -> Any:
        return SimpleNamespace(content=content)

    def add_folder(self, label: str) -> Any:
        return Folder()

    def add_slider(self, label: str, least: float, most: float, step: float, value: float, hint: str) -> Any:
        slider = SimpleNamespace(
            min=least, max=most, value=value, on_update=lambda call: setattr(slider, "moved", call)
        )
        self.sliders[label] = slider
        return slider


class Folder:
    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...


class Desk:
    """A desk without processes."""

    def __init__(self, **words: object) -> None:
        self.config, self.verdict, self.checking = run_config(**words), (), False

    def set_gain(self, name: str, value: float) -> None:
        self.config = with_gain(self.config, name, value)


def make_panel(**words: object) -> tuple[GainsPanel, Any, Any]:
    gui, desk = Gui(), Desk(mode="follow", **words)
    panel = GainsPanel(gui, desk, lambda does: does)  # pyright: ignore[reportArgumentType]
    panel.rebuild()
    return panel, desk, gui.sliders["k_r [N/m]"]


def type_value(slider: Any, value: float) -> None:
    slider.value = value
    slider.moved(None)


def test_number_beyond_slider_is_refused_and_the_gain_restored(monkeypatch: pytest.MonkeyPatch) -> None:
    panel, desk, slider = make_panel()
    type_value(slider, 400.0)
    with pytest.raises(ParameterError, match="k_r is 20000; expected 10 to 12000 N/m"):
        type_value(slider, 20000.0)
    assert desk.config.mode.stiffness == 400.0
    panel.write()
    assert slider.value == 20000.0  # typing may not be finished
    monkeypatch.setattr(gains_panel, "PENDING_EDIT_TIME", -1.0)
    panel.write()
    assert slider.value == 400.0


def test_slider_keeps_pending_value_and_follows_undo() -> None:
    panel, desk, slider = make_panel()
    slider.value = 500.0
    panel.write()
    assert slider.value == 500.0
    slider.moved(None)
    panel.write()
    desk.set_gain("stiffness", 300.0)  # by undo
    panel.write()
    assert slider.value == 300.0


def test_slider_range_includes_a_gain_from_the_command_line() -> None:
    _, desk, slider = make_panel(stiffness=20000.0)
    assert slider.value == slider.max == desk.config.mode.stiffness == 20000.0
