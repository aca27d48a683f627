"""Panel of the live page with the gains as sliders, and the verdict on their stability."""

import html
from collections.abc import Callable
from typing import Any

import viser

from experiments.live.panels.acts import Acts
from experiments.live.session.desk import Desk
from experiments.live.session.gain_verdict import GainVerdict
from experiments.live.session.gains import Gain, gains_of

COLORS = {"certified": "#1d8a3a", "refuted": "#c02020", "unknown": "#a8700a"}
_WORDS = {"certified": "stable", "refuted": "unstable", "unknown": "unknown"}


class GainsPanel:
    """Sliders of the current mode; the arguments are those of `ClockPanel`."""

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts):
        self._gui, self._desk, self._acts = gui, desk, acts
        self._verdict = gui.add_html("")
        self._folder = gui.add_folder("Gains")
        self._sliders: dict[Gain, viser.GuiSliderHandle[float]] = {}

    def rebuild(self) -> None:
        """Make the sliders of the current mode."""
        for slider in self._sliders.values():
            slider.remove()
        self._sliders.clear()
        if self._desk.config is None:
            return
        with self._folder:
            for gain, value in gains_of(self._desk.config).items():
                shown = min(max(value, gain.least), gain.most)
                slider = self._gui.add_slider(
                    f"{gain.symbol} [{gain.unit}]", gain.least, gain.most, gain.step, shown, hint=gain.name
                )
                slider.on_update(self._acts(self._moves(gain, slider)))
                self._sliders[gain] = slider

    def write(self) -> None:
        """Show the verdict, and update sliders whose gains were undone or redone."""
        desk = self._desk
        self._verdict.content = verdict_html(desk.verdict, desk.checking)
        if desk.config is None:
            return
        for gain, value in gains_of(desk.config).items():
            slider = self._sliders.get(gain)
            if slider is not None and abs(slider.value - value) > 0.5 * gain.step and not self._is_beyond(gain, value):
                slider.value = value

    def _is_beyond(self, gain: Gain, value: float) -> bool:
        return not gain.least <= value <= gain.most

    def _moves(self, gain: Gain, slider: Any) -> Callable[[Any], None]:
        return lambda event: self._desk.set_gain(gain.name, slider.value)


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
