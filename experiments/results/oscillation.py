"""Whether a run's loop was stable: where it shook, how fast that grew, and what moved at high frequency."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controllers.safety.oscillation import OscillationDetector, shaken
from controllers.state import Array
from sim.recording.recording import Recording

_ROWS = 16_000  # of the recording, read at a time
# At 0.85 of the critical gain a loop rings for up to 0.15 s at a time; beyond the critical one it goes on.
_SHAKEN = 0.25  # [s] of shaking without a break that is told
_WINDOW = 0.02  # [s] of the envelope from which the growth is taken


@dataclass(frozen=True)
class OscillationSummary:
    """Stability of a run as it was measured, by the detector that guards real devices.

    Attributes
    ----------
    since : float or None
        When it began to shake for a quarter of a second or more [s]; None if it never did.
    share : float
        Of the time in which it shook.
    frequency : float or None
        Of the shaking, from the zeros of the fast force [Hz].
    force_rms, force_max : float
        Force at the hand above the detector's corner, 15 Hz [N].
    motion_rms_mm : float
        Motion across the curve above 15 Hz.
    growth : float or None
        Fastest growth of that motion, over 60 ms up to the first second of shaking [1/s]; None if it did not shake.
    """

    since: float | None
    share: float
    frequency: float | None
    force_rms: float
    force_max: float
    motion_rms_mm: float
    growth: float | None

    def lines(self) -> list[str]:
        """What is to be said, if anything."""
        if self.since is None:
            return []
        grew = "" if self.growth is None else f", growing at up to {self.growth:.0f}/s"
        at = "" if self.frequency is None else f" at {self.frequency:.0f} Hz"
        return [
            f"It oscillates: the loop shakes from {self.since:.2f} s on, {100 * self.share:.0f} % of the time{at}, "
            f"with up to {self.force_max:.1f} N and {self.motion_rms_mm:.2f} mm RMS across the curve{grew}; "
            "hvf certify says which gains are stable; with those it is rounded encoders, which much damping makes felt."
        ]


def oscillation_summary(recording: Recording) -> OscillationSummary:
    """Measure a recording with the channels ``t``, ``force``, ``p`` and ``nearest`` of its ticks."""
    ticks, period = recording.groups["ticks"], 1.0 / recording.rates["ticks"]
    detector, measure = OscillationDetector(period), _Fast(period)
    memory: list[float] = detector.fresh_memory().tolist()
    count, unbroken, since, n = 0, 0, math.nan, len(ticks["t"])
    for first in range(0, n, _ROWS):
        rows = slice(first, first + _ROWS)
        force = np.nan_to_num(ticks["force"][rows])
        found = shaken(detector, force, memory)
        measure.add(force, np.nan_to_num(ticks["p"][rows] - ticks["nearest"][rows]), found)
        count += int(found.sum())
        # How long it has shaken at each tick, what came before this block included.
        at = np.arange(len(found))
        stopped = np.maximum.accumulate(np.where(found, -1 - unbroken, at))
        going = np.where(found, at - stopped, 0)
        unbroken = int(going[-1])
        if math.isnan(since) and going.max() * period >= _SHAKEN:
            first_told = int(np.argmax(going * period >= _SHAKEN))
            since = float(ticks["t"][rows][first_told]) - (int(going[first_told]) - 1) * period
    told = not math.isnan(since)
    return OscillationSummary(
        since if told else None, count / max(n, 1), measure.frequency() if told else None, measure.force.root,
        measure.force.largest, 1e3 * measure.motion.root, measure.growth(since) if told else None,
    )  # fmt: skip


class _Size:
    """Root mean square and largest size of vectors that come in blocks."""

    def __init__(self) -> None:
        self._sum, self._count, self.largest = 0.0, 0, 0.0

    def add(self, vectors: Array) -> None:
        square = np.sum(vectors**2, axis=1)
        self._sum, self._count = self._sum + float(square.sum()), self._count + len(square)
        self.largest = max(self.largest, math.sqrt(float(square.max(initial=0.0))))

    @property
    def root(self) -> float:
        return math.sqrt(self._sum / max(self._count, 1))


class _Fast:
    """Force and motion above the detector's corner, in blocks."""

    def __init__(self, period: float) -> None:
        from scipy.signal import butter  # a run begins without it

        self._period = period
        corner = OscillationDetector(period).corner
        self._sections: Array = np.asarray(butter(2, corner, "highpass", fs=1.0 / period, output="sos"))
        self._states = [np.zeros((len(self._sections), 2, 3)) for _ in range(2)]
        self.force, self.motion = _Size(), _Size()
        self._turns, self._shaken, self._last = 0, 0, np.zeros(3)
        self._envelope: list[float] = []

    def add(self, force: Array, away: Array, found: npt.NDArray[np.bool_]) -> None:
        from scipy.signal import sosfilt

        if not self._envelope:
            # A run begins with a force and a place, not with a step to them.
            for state, values in zip(self._states, (force, away), strict=True):
                state[:] = _settled(self._sections, values[0])
        fast = [np.zeros((0, 3))] * 2
        for i, values in enumerate((force, away)):
            fast[i], self._states[i] = sosfilt(self._sections, values, axis=0, zi=self._states[i])
        self.force.add(fast[0])
        self.motion.add(fast[1])
        # Zeros of the component that moves most.
        axis = int(np.argmax(np.sum(fast[0] ** 2, axis=0)))
        changes = np.diff(np.signbit(fast[0][:, axis]), prepend=np.signbit(self._last[axis]))
        self._turns, self._shaken = self._turns + int(np.sum(changes & found)), self._shaken + int(found.sum())
        self._last = fast[0][-1]
        width = max(1, round(_WINDOW / self._period))
        whole = len(fast[1]) // width * width
        blocks = np.sum(fast[1][:whole] ** 2, axis=1).reshape(-1, width)
        self._envelope += np.sqrt(blocks.mean(axis=1)).tolist()

    def frequency(self) -> float | None:
        return self._turns / (2.0 * self._shaken * self._period) if self._shaken else None

    def growth(self, since: float) -> float | None:
        """Largest slope of the logarithm of the envelope over three windows, up to a second after `since` [s]."""
        envelope = np.array(self._envelope[: int((since + 1.0) / _WINDOW) + 1])
        if len(envelope) < 4:
            return None
        slopes = np.log(np.maximum(envelope[3:], 1e-9) / np.maximum(envelope[:-3], 1e-9)) / (3.0 * _WINDOW)
        return float(slopes.max())


def _settled(sections: Array, value: Array) -> Array:
    """State of the filter that has seen a constant for ever."""
    from scipy.signal import sosfilt_zi

    return sosfilt_zi(sections)[:, :, None] * value
