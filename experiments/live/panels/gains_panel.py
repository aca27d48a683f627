"""Panel of the live page with the gains as sliders, and the verdict on their stability."""

import html
import math
import time
from collections.abc import Callable
from typing import Any

import viser

from controllers.errors import ParameterError
from experiments.live.panels.acts import Acts
from experiments.live.session.desk import Desk
from experiments.live.session.gain_verdict import GainVerdict
from experiments.live.session.gains import Gain, gains_of

COLORS = {"certified": "#1d8a3a", "refuted": "#c02020", "unknown": "#a8700a"}
TYPING = 2.0  # [s] for which a number that is not the gain stays in its field
_WORDS = {"certified": "stable", "refuted": "unstable", "unknown": "unknown"}


class GainsPanel:
    """Sliders of the current mode; the arguments are those of `ClockPanel`."""

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts):
        self._gui, self._desk, self._acts = gui, desk, acts
        self._verdict = gui.add_html("")
        self._folder = gui.add_folder("Gains")
        self._sliders: dict[Gain, viser.GuiSliderHandle[float]] = {}
        self._known: dict[Gain, float] = {}
        self._apart: dict[Gain, tuple[float, float]] = {}

    def rebuild(self) -> None:
        """Make the sliders of the current mode."""
        for slider in self._sliders.values():
            slider.remove()
        self._sliders.clear()
        self._apart.clear()
        if self._desk.config is None:
            return
        with self._folder:
            for gain, value in gains_of(self._desk.config).items():
                ends = min(gain.least, value), max(gain.most, value)  # also of a gain of the command line
                slider = self._gui.add_slider(f"{gain.symbol} [{gain.unit}]", *ends, gain.step, value, hint=gain.name)
                slider.on_update(self._acts(self._moves(gain, slider)))
                self._sliders[gain], self._known[gain] = slider, value

    def write(self) -> None:
        """Show the verdict, and update sliders whose gains were undone, redone or refused."""
        desk = self._desk
        self._verdict.content = verdict_html(desk.verdict, desk.checking)
        if desk.config is None:
            return
        for gain, value in gains_of(desk.config).items():
            slider = self._sliders.get(gain)
            if slider is None:
                continue
            if abs(slider.value - value) <= 0.5 * gain.step:
                self._apart.pop(gain, None)
            elif value != self._known[gain] or self._stands(gain, slider.value):
                slider.value = value
            self._known[gain] = value

    def _stands(self, gain: Gain, shown: float) -> bool:
        """Whether a slider has shown what is not the gain for `TYPING`; before, it may be typed, or not handled yet."""
        now = time.monotonic()
        if self._apart.get(gain, (math.nan, 0.0))[0] != shown:
            self._apart[gain] = shown, now
        return now - self._apart[gain][1] > TYPING

    def _moves(self, gain: Gain, slider: Any) -> Callable[[Any], None]:
        def moved(event: Any) -> None:
            value = slider.value
            if not slider.min <= value <= slider.max:
                raise ParameterError(
                    f"{gain.symbol} is {value:g}; expected {slider.min:g} to {slider.max:g} {gain.unit}"
                )
            self._desk.set_gain(gain.name, value)
            self._known[gain] = value

        return moved


def verdict_html(verdicts: tuple[GainVerdict, ...], checking: bool) -> str:
    """HTML of the verdicts of a run, a short block each: green, red or amber, with margin.

    The reason of a certified law is folded away; that of any other law is shown.
    """
    if not verdicts:
        return '<p style="margin:.5rem .75rem;color:#a8700a"><b>checking…</b></p>'
    blocks: list[str] = []
    for found in verdicts:
        color, reason = COLORS[found.verdict], html.escape(found.reason)
        margin = "" if found.margin is None else f" up to {found.margin + 1.0:.3g} times k_r"
        passive = f"Passivity {html.escape(found.passive)}." if found.passive else ""
        said, more = ("", f"It {reason}. {passive}") if found.verdict == "certified" else (f"<br>{reason}.", passive)
        why = f'<details><summary style="cursor:pointer">why</summary>{more}</details>' if more else ""
        blocks.append(
            f'<div class="verdict-{found.verdict}" style="margin:.4rem .75rem;padding:.2rem .6rem;font-size:.8rem;'
            f'border-left:6px solid {color}"><b style="color:{color}">{html.escape(found.law)}: '
            f"{_WORDS[found.verdict]}</b>{margin}{' · checking…' if checking else ''}{said}{why}</div>"
        )
    return "".join(blocks)
