"""The panel that chooses the next run: what the session was started with stays, whatever mode and map are chosen."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from experiments.config.options import run_config
from experiments.config.run_config import Clock
from experiments.live.panels.run_panel import RunPanel
from experiments.live.session.desk import Desk
from models.humanoid.skeleton import DEFAULT_MASS


class Control(SimpleNamespace):
    """A folder, a list or a button without a browser."""

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def on_update(self, _: object) -> None: ...

    on_click = on_update

    def remove(self) -> None: ...


class Gui:
    """A GUI without a browser; `lists` are its drop-down lists by label."""

    def __init__(self) -> None:
        self.lists: dict[str, Control] = {}

    def add_folder(self, label: str) -> Control:
        return Control()

    def add_button(self, label: str, **_: object) -> Control:
        return Control()

    def add_dropdown(self, label: str, options: tuple[str, ...], initial_value: str) -> Control:
        assert initial_value in options
        self.lists[label] = Control(value=initial_value)
        return self.lists[label]


def chosen(mode: str, figure: str, **started: Any) -> Any:
    """The run chosen on a page that was started with a configuration."""
    gui, desk = Gui(), SimpleNamespace(clips={})
    desk.offer = partial(Desk.offer, desk)
    config = replace(run_config(mode="follow", **started), clock=Clock(servo_period=2e-3))
    panel: Any = RunPanel(gui, desk, lambda does: does, config)  # pyright: ignore[reportArgumentType]
    gui.lists["Mode"].value, gui.lists["Figure"].value = mode, figure
    panel._rebuild_slots()
    return panel.config()


@pytest.mark.parametrize("mode", ["follow", "bunny", "stretch-then-follow", "lead"])
def test_next_run_keeps_size_seed_and_rates_of_the_session(mode: str) -> None:
    run = chosen(mode, "physical", stature=1.6, mass=55.0, seed=7)
    assert (run.mode.kind, run.figure.stature, run.figure.mass, run.seed) == (mode, 1.6, 55.0, 7)
    assert run.clock.servo_period == 2e-3


@pytest.mark.parametrize("files", [("mine.amc", "yours.bvh"), ("a/walk.bvh", "b/walk.bvh")])
def test_next_run_plays_the_motion_files_that_the_session_was_started_with(files: tuple[str, str]) -> None:
    clips = (files[0], "walk", files[1], "cheer")
    assert chosen("bunny", "physical", clips=clips).map.clips == clips


def test_kinematic_figure_keeps_the_stature_and_has_no_mass() -> None:
    run = chosen("follow", "kinematic", stature=1.6, mass=55.0)
    assert (run.figure.kind, run.figure.stature, run.figure.mass) == ("kinematic", 1.6, DEFAULT_MASS)
