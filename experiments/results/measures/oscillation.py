r"""Measured stability of the loop in a run: when it oscillated, how fast that grew, and which motion there was.

The oscillation detector that guards real devices reports a shaking force. It also does so in a stable loop whose
damping turns the quantisation of the encoders into a force: there the reading shakes but the stylus does not. The two
are told apart by the size of the fast motion x relative to what quantisation alone gives for a stylus at rest,

.. math:: r^2 = \max(\overline{x_\perp^2} / 2,\ \overline{x^2} / 3) / \sigma^2, \quad
   \sigma^2 = \mathrm{tr}(J\,\mathrm{diag}(\delta^2)\,J^\top) / 36

where x⊥ is the part of x across the curve, δ the encoder steps, and δ²/12 the variance of the quantisation error.
Quantisation alone gives r = 1; r exceeds √2 where the stylus itself moves more than the quantisation error.
"""

import math
from dataclasses import dataclass

import numpy as np

from controllers.safety.oscillation import OscillationDetector, oscillating_ticks
from experiments.results.measures.blocks import BLOCK_ROWS
from experiments.results.measures.figure_measure import MeanSquare
from geometry.arrays import Array, Mask
from models.phantom.parameters import PREMIUM_1_5
from sim.recording.recording import Recording

# At 0.85 of the critical gain a loop rings for up to 0.15 s at a time; above the critical gain it does not stop.
_MIN_SHAKING_TIME = 0.25  # [s] of uninterrupted shaking from which it is reported
_WINDOW_TIME = 0.02  # [s] over which the envelope of the motion is averaged
_CORNER_FREQUENCY = 40.0  # [Hz] above voluntary motion; tremor (8 to 12 Hz) is attenuated to a tenth
_MEDIAN_WINDOWS = 50  # windows of shaking in a running median: too many for a push or a change of river to affect it
# σ of the Premium 1.5 in mid-workspace, where J is diagonal; along curves it is less than 1.25 times this.
_QUANTISATION_NOISE = (
    math.hypot(*np.multiply(PREMIUM_1_5.encoder_step, (PREMIUM_1_5.l1, PREMIUM_1_5.l1, PREMIUM_1_5.l2))) / 6.0
)
_MIN_MOTION_RATIO = math.sqrt(2.0)  # r of a stylus that moves as much as the quantisation error of its reading


@dataclass(frozen=True)
class OscillationSummary:
    """Measured stability of a run, by the oscillation detector that guards real devices.

    Attributes
    ----------
    since : float or None
        Start of the first shaking that lasted a quarter of a second or more [s]; None if there was none.
    share : float
        Share of the run's time in which the loop shook.
    frequency : float or None
        Frequency of the shaking, from the zero crossings of the high-passed force [Hz].
    force_rms, force_max : float
        Force at the hand above the detector's corner frequency, 15 Hz [N].
    motion_rms_mm : float
        RMS motion across the curve above 40 Hz.
    motion_over_rounding : float or None
        Largest r over a second of shaking; None if the loop did not shake.
    oscillates : bool
        Whether the stylus itself shook, and not only its quantised reading.
    growth : float or None
        Fastest growth rate of the motion across the curve over 60 ms, until a second after `since` [1/s]; None if the
        loop did not shake.
    """

    since: float | None
    share: float
    frequency: float | None
    force_rms: float
    force_max: float
    motion_rms_mm: float
    motion_over_rounding: float | None
    oscillates: bool
    growth: float | None

    def lines(self) -> list[str]:
        """The finding in words; empty if the loop did not oscillate."""
        if self.since is None:
            return []
        at = "" if self.frequency is None else f" at {self.frequency:.0f} Hz"
        when, force = f"from {self.since:.2f} s on, {100 * self.share:.0f} % of the time{at}", f"{self.force_max:.1f} N"
        if not self.oscillates:
            return [
                f"Rounded encoders are felt {when}, in the force by up to {force}: the stylus does not oscillate; "
                "damping turns the steps of its reading into force, so less damping is quieter."
            ]
        grew = "" if self.growth is None else f", growing at up to {self.growth:.0f}/s"
        return [
            f"It oscillates {when}: the force by up to {force}, the stylus by {self.motion_rms_mm:.2f} mm RMS across "
            f"the curve{grew}; hvf certify says which gains are stable."
        ]


def oscillation_summary(recording: Recording) -> OscillationSummary:
    """Measure a recording, from the channels ``t``, ``force``, ``p`` and ``nearest`` of its ticks."""
    ticks, period = recording.groups["ticks"], 1.0 / recording.rates["ticks"]
    detector, measure = OscillationDetector(period), _FastMotion(period)
    memory: list[float] = detector.fresh_memory().tolist()
    count, unbroken, since, n = 0, 0, math.nan, len(ticks["t"])
    for first in range(0, n, BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        force = np.nan_to_num(ticks["force"][rows])
        found = oscillating_ticks(detector, force, memory)
        p, nearest = ticks["p"][rows], ticks["nearest"][rows]
        measure.add(force, np.nan_to_num(p), np.nan_to_num(p - nearest), found)
        count += int(found.sum())
        # Number of ticks of uninterrupted shaking up to each tick, including the end of the previous block.
        ticks_in_block = np.arange(len(found))
        last_calm = np.maximum.accumulate(np.where(found, -1 - unbroken, ticks_in_block))
        shaking_ticks = np.where(found, ticks_in_block - last_calm, 0)
        unbroken = int(shaking_ticks[-1])
        if math.isnan(since) and shaking_ticks.max() * period >= _MIN_SHAKING_TIME:
            first_reported = int(np.argmax(shaking_ticks * period >= _MIN_SHAKING_TIME))
            since = float(ticks["t"][rows][first_reported]) - (int(shaking_ticks[first_reported]) - 1) * period
    reported = not math.isnan(since)
    motion_ratio = measure.over_rounding() if reported else None
    oscillates = motion_ratio is not None and motion_ratio > _MIN_MOTION_RATIO
    return OscillationSummary(
        since if reported else None, count / max(n, 1), measure.frequency() if reported else None, measure.force.root,
        measure.force.largest, 1e3 * measure.motion.root, motion_ratio, oscillates,
        measure.growth(since) if reported else None,
    )  # fmt: skip


class _FastMotion:
    """Force above the detector's corner frequency, and motion above that of the hand, filtered block by block."""

    def __init__(self, period: float) -> None:
        from scipy.signal import butter  # imported late, as the start of a run does not need it

        self._period = period
        corners = (OscillationDetector(period).corner, _CORNER_FREQUENCY, _CORNER_FREQUENCY)
        self._sections: list[Array] = [
            np.asarray(butter(2, corner, "highpass", fs=1.0 / period, output="sos")) for corner in corners
        ]
        self._states: list[Array] = []
        self.force, self.motion = MeanSquare(), MeanSquare()
        self._crossing_count, self._shaking_ticks, self._last_force = 0, 0, np.zeros(3)
        self._motion_windows: list[Array] = []

    def add(self, force: Array, place: Array, away: Array, found: Mask) -> None:
        from scipy.signal import sosfilt

        inputs = (force, place, away)
        if not self._states:
            # The filters start settled on the first values, so that these are no step.
            self._states = [_settled_state(*pair) for pair in zip(self._sections, (v[0] for v in inputs), strict=True)]
        fast = list(inputs)
        for i, values in enumerate(inputs):
            fast[i], self._states[i] = sosfilt(self._sections[i], values, axis=0, zi=self._states[i])
        self.force.add(fast[0])
        self.motion.add(fast[2])
        # Zero crossings of the force component with the most energy.
        axis = int(np.argmax(np.sum(fast[0] ** 2, axis=0)))
        changes = np.diff(np.signbit(fast[0][:, axis]), prepend=np.signbit(self._last_force[axis]))
        self._crossing_count, self._shaking_ticks = (
            self._crossing_count + int(np.sum(changes & found)),
            self._shaking_ticks + int(found.sum()),
        )
        self._last_force = fast[0][-1]
        width = max(1, round(_WINDOW_TIME / self._period))
        whole = len(found) // width * width
        total, across = (np.sum(moved[:whole] ** 2, axis=1) for moved in fast[1:])
        self._motion_windows.append(np.stack((total, across, found[:whole]), axis=1).reshape(-1, width, 3).mean(axis=1))

    def over_rounding(self) -> float:
        """Largest r: the largest median over `_MEDIAN_WINDOWS` successive windows of shaking."""
        total, across, found = np.concatenate(self._motion_windows).T
        ratio = np.sqrt(np.maximum(across / 2.0, total / 3.0))[found > 0.5] / _QUANTISATION_NOISE
        windows = np.lib.stride_tricks.sliding_window_view(ratio, min(_MEDIAN_WINDOWS, len(ratio)))
        return float(np.median(windows, axis=1).max())

    def frequency(self) -> float | None:
        return self._crossing_count / (2.0 * self._shaking_ticks * self._period) if self._shaking_ticks else None

    def growth(self, since: float) -> float | None:
        """Largest slope of the logarithm of the envelope over three windows, up to a second after `since` [s]."""
        envelope = np.sqrt(np.concatenate(self._motion_windows)[: int((since + 1.0) / _WINDOW_TIME) + 1, 1])
        if len(envelope) < 4:
            return None
        slopes = np.log(np.maximum(envelope[3:], 1e-9) / np.maximum(envelope[:-3], 1e-9)) / (3.0 * _WINDOW_TIME)
        return float(slopes.max())


def _settled_state(sections: Array, value: Array) -> Array:
    """State of a filter that has settled on a constant input."""
    from scipy.signal import sosfilt_zi

    return sosfilt_zi(sections)[:, :, None] * value
