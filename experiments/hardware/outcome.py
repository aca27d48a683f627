"""Outcome of a hardware run, from its recording and from the servo's final report."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controllers.safety.arming import State
from controllers.safety.faults import Fault
from experiments.hardware.link import Link
from geometry.arrays import rms
from sim.hardware.controls import RunStatus
from sim.hardware.servo_process import Ended, Ready
from sim.recording.recording import Recording, RecordingError


@dataclass(frozen=True)
class Outcome:
    """Outcome of a hardware run.

    Attributes
    ----------
    device, transport : str
        Name and transport of the device.
    fault : str
        Fault that was latched at the end; empty if there was none.
    let_go : tuple of str
        All faults at which the device released its force, with their times; all but the last may have been cleared.
    stopped : bool
        Whether the servo stopped ticking before the end, without an order.
    silent : bool
        Whether the servo's process ended without a final report.
    watchdog : bool
        Whether the device has a watchdog.
    broken : str
        Program error in the servo's process.
    ticks, missed : int
        Number of ticks run, and of deadlines missed.
    compute, lateness : three floats
        p50, p99, p99.9 of a tick's computing time and of its lateness [s]; None if the servo was killed.
    memory_growth, descriptors : float, int
        Growth of the servo's process after its first second: memory [MB] and open files; None if it was killed.
    recorded, dropped : int
        Number of ticks in the recording, and of ticks that the recorder's process did not take in time.
    active : float
        Time under full force [s].
    distance, force, heat : float
        While active: RMS distance from the curve [m], largest force [N], largest share of a motor's thermal limit.
    link : Link
        Quality of the link.
    apart, hand_force : float
        While active: RMS error of the twin's one-tick prediction [m], largest hand force estimated by the twin [N].
    """

    device: str
    transport: str
    fault: str
    let_go: tuple[str, ...]
    stopped: bool
    silent: bool
    watchdog: bool
    broken: str
    ticks: int
    missed: int
    compute: tuple[float, float, float] | None
    lateness: tuple[float, float, float] | None
    memory_growth: float | None
    descriptors: int | None
    recorded: int
    dropped: int
    active: float
    distance: float
    force: float
    heat: float
    link: Link
    apart: float
    hand_force: float

    @property
    def sound(self) -> bool:
        """Whether the run ended without a fault or failure."""
        return not (self.fault or self.stopped or self.silent or self.broken)

    def to_json(self) -> dict[str, object]:
        """All attributes by name, as plain data."""
        return {**asdict(self), "link": self.link._asdict()}

    def _force_lines(self, name: str) -> list[str]:
        return [
            f"{name}: {self.active:.1f} s under force, {1e3 * self.distance:.2f} mm RMS from the curve, at most "
            f"{self.force:.2f} N and {self.heat:.0%} of the motors' heat.",
            f"The twin predicted a tick within {1e3 * self.apart:.3f} mm RMS; the hand pushed with at most "
            f"{self.hand_force:.2f} N (estimated; with the errors of friction and inertia).",
        ]

    def lines(self) -> list[str]:
        """The outcome in words, faults and failures first."""
        errors = [f"The motors were switched off: {self.fault}."] if self.fault else []
        if len(self.let_go) > bool(self.fault):
            errors += [f"The motors were switched off {len(self.let_go)} times: {'; '.join(self.let_go[:3])}."]
        if self.silent:
            after = "the watchdog switched the motors off" if self.watchdog else "its motors have no watchdog"
            errors.append(f"The servo's process ended early; {after}.")
        elif self.stopped:
            errors.append("The servo stopped before the end of the run.")
        errors += [f"The servo failed: {self.broken.strip().splitlines()[-1]}"] if self.broken else []
        name = f"{self.device} ({self.transport})"
        return [
            *errors,
            *(self._force_lines(name) if self.active > 0.0 else [f"{name}: it was never under force."]),
            f"{self.ticks} ticks, {self.missed} deadlines missed; {self._timing_text()}.",
            f"The device answered: {'; '.join(self.link.lines())}.",
            f"{self._growth_text()}; {self.recorded} ticks are recorded, {self.dropped} were dropped.",
        ]

    def _timing_text(self) -> str:
        if self.compute is None or self.lateness is None:
            return "their durations and lateness are unknown, as the servo ended early"
        compute, late = (" / ".join(f"{1e6 * value:.0f}" for value in times) for times in (self.compute, self.lateness))
        return f"p50 / p99 / p99.9: computing {compute} µs, late by {late} µs"

    def _growth_text(self) -> str:
        if self.memory_growth is None:
            return "The servo's growth is unknown"
        return f"The servo grew by {self.memory_growth:.2f} MB and {self.descriptors} open files"


def outcome_of(recording: Path, ready: Ready, ended: Ended | None, last: RunStatus) -> Outcome:
    """The outcome of a run that has ended."""
    found = _summarize_recording(recording)
    return Outcome(
        device=ready.identity.name, transport=ready.identity.transport,
        fault="" if last.fault is Fault.NONE else last.fault_text, stopped=not last.alive,
        silent=ended is None, watchdog=ready.identity.watchdog, broken=ended.broken if ended else "",
        ticks=ended.ticks if ended else int(last.row["tick"]),
        missed=ended.missed if ended else int(last.row["missed"]), compute=ended.compute[:3] if ended else None,
        lateness=ended.lateness[:3] if ended else None, memory_growth=ended.memory_growth if ended else None,
        descriptors=ended.descriptors if ended else None, **found,
    )  # fmt: skip


def holds_ticks(path: Path) -> bool:
    """Whether a recording has a tick; a file that cannot be read counts as if it had."""
    try:
        with Recording(path) as recording:
            return len(recording.groups["ticks"]["state"]) > 0
    except RecordingError:
        return path.exists()


def _summarize_recording(path: Path) -> dict[str, Any]:
    empty: dict[str, Any] = dict.fromkeys(
        ("recorded", "dropped", "active", "distance", "force", "heat", "apart", "hand_force"), 0
    ) | {"let_go": (), "link": Link.of(0.0, (0, 0, 0), np.full((1, 3), np.nan))}
    try:
        recording = Recording(path)
    except RecordingError:
        return empty
    with recording:
        channels = recording.groups["ticks"]
        if not len(channels["state"]):
            return empty
        state = channels["state"][:]
        is_active = state == State.ACTIVE
        rows = {
            name: recording.channel("ticks", name)[:] for name in ("distance", "force", "heat", "apart", "hand_force")
        }
        rows = {name: rows[name][is_active] for name in rows if name in channels}
        sizes = {name: np.linalg.norm(rows[name], axis=1) for name in ("force", "hand_force")}
        t, fault, value = (recording.channel("ticks", name)[:] for name in ("t", "fault", "fault_value"))
        sequence, lost, refused, *times = (
            recording.channel("ticks", name)[:]
            for name in ("sequence", "lost", "refused", "round_trip", "jitter", "staleness")
        )
        new = np.diff(sequence, prepend=0.0) != 0.0
        counts = np.sum(new), lost[-1], refused[-1]
        fault_starts = np.flatnonzero((fault > 0.0) & (np.concatenate(([0.0], fault[:-1])) == 0.0))
        return {
            "let_go": tuple(f"{t[k]:.3f} s, {Fault(int(fault[k])).words(value[k])}" for k in fault_starts),
            "recorded": len(state), "dropped": int(recording.channel("ticks", "dropped")[-1]),
            "active": float(np.sum(is_active)) / recording.rates["ticks"],
            "distance": rms(rows["distance"]),
            "force": float(sizes["force"].max(initial=0.0)), "heat": float(rows["heat"].max(initial=0.0)),
            "apart": rms(rows["apart"]),
            "hand_force": float(sizes["hand_force"].max(initial=0.0)),
            "link": Link.of(float(t[-1] - t[0]), counts, np.stack(times, axis=1)[new]),
        }  # fmt: skip
