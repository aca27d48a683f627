"""Panel of the live page with the gains as sliders, and the verdict on their stability."""

import html
import math
import time
from collections.abc import Callable
from typing import Any

import viser

from controllers.errors import ParameterError
from experiments.live.panels import Acts
from experiments.live.session.desk import Desk
from experiments.live.session.gain_verdict import GainVerdict
from experiments.live.session.gains import Gain, gains_of

COLORS = {"certified": "#1d8a3a", "refuted": "#c02020", "unknown": "#a8700a"}
PENDING_EDIT_TIME = 2.0  # [s] for which a number that differs from the gain stays in its field
_WORDS = {"certified": "stable", "refuted": "unstable", "unknown": "unknown"}


class GainsPanel:
    """Sliders of the current mode; the arguments are those of `ClockPanel`."""

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts):
        self._gui, self._desk, self._acts = gui, desk, acts
        self._verdict = gui.add_html("")
        self._folder = gui.add_folder("Gains")
        self._sliders: dict[Gain, viser.GuiSliderHandle[float]] = {}
        self._last_values: dict[Gain, float] = {}
        self._differing: dict[Gain, tuple[float, float]] = {}

    def rebuild(self) -> None:
        """Create the sliders of the current mode."""
        for slider in self._sliders.values():
            slider.remove()
        self._sliders.clear()
        self._differing.clear()
        if self._desk.config is None:
            return
        with self._folder:
            for gain, value in gains_of(self._desk.config).items():
                ends = min(gain.least, value), max(gain.most, value)  # also includes a gain from the command line
                slider = self._gui.add_slider(f"{gain.symbol} [{gain.unit}]", *ends, gain.step, value, hint=gain.name)
                slider.on_update(self._acts(self._slider_handler(gain, slider)))
                self._sliders[gain], self._last_values[gain] = slider, value

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
                self._differing.pop(gain, None)
            elif value != self._last_values[gain] or self._differs_for_long(gain, slider.value):
                slider.value = value
            self._last_values[gain] = value

    def _differs_for_long(self, gain: Gain, shown: float) -> bool:
        """Whether a slider has differed from its gain for `PENDING_EDIT_TIME`; until then its edit may be pending."""
        now = time.monotonic()
        if self._differing.get(gain, (math.nan, 0.0))[0] != shown:
            self._differing[gain] = shown, now
        return now - self._differing[gain][1] > PENDING_EDIT_TIME

    def _slider_handler(self, gain: Gain, slider: Any) -> Callable[[Any], None]:
        def on_move(event: Any) -> None:
            value = slider.value
            if not slider.min <= value <= slider.max:
                raise ParameterError(
                    f"{gain.symbol} is {value:g}; expected {slider.min:g} to {slider.max:g} {gain.unit}"
                )
            self._desk.set_gain(gain.name, value)
            self._last_values[gain] = value

        return on_move


def verdict_html(verdicts: tuple[GainVerdict, ...], checking: bool) -> str:
    """HTML of the verdicts of a run, a short block each: green, red or amber, with margin.

    The reason of a certified law is folded away; that of any other law is shown.
    """
    if not verdicts:
        return '<p style="margin:.5rem .75rem;color:#a8700a"><b>checking…</b></p>'
    blocks: list[str] = []
    for verdict in verdicts:
        stable, passive, margin = verdict.stability, verdict.passivity, ""
        color, reason = COLORS[stable.verdict], f"{html.escape(stable.reason)}."
        if stable.margin is not None and stable.verdict != "refuted":
            margin = f" up to {stable.margin + 1.0:.3g} times k_r"
        shown, details = ("", f"{reason} ") if stable.verdict == "certified" else (f"<br>{reason}", "")
        if passive is not None:
            details += f"Passivity {passive.verdict}: {html.escape(passive.reason)}."
        fold = f'<details><summary style="cursor:pointer">why</summary>{details}</details>' if details else ""
        blocks.append(
            f'<div class="verdict-{stable.verdict}" style="margin:.4rem .75rem;padding:.2rem .6rem;font-size:.8rem;'
            f'border-left:6px solid {color}"><b style="color:{color}">{html.escape(verdict.law)}: '
            f"{_WORDS[stable.verdict]}</b>{margin}{' · checking…' if checking else ''}{shown}{fold}</div>"
        )
    return "".join(blocks)
