"""Measures of the editing of a curve, for each press of the switch, and of its performance, from the recording."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.stretchy_tubes import CLICK_DISTANCE, CLICK_TIME, StretchyTubes
from experiments.results.measures.blocks import ROWS
from experiments.results.measures.phases import EditingSummary, PerformanceSummary, PressKind, PressSummary
from experiments.results.measures.run_measures import Span, measure_span
from geometry.arrays import Array
from sim.recording.recording import Channel, Recording

_PRESS_CHANNELS = ("t", "p", "user", "phase", "nearest", "distance")
_MAX_HELD_DISTANCE = 1e-9  # [m] distance from the stylus below which a point of the curve counts as held


def editing_summary(
    recording: Recording, tubes: StretchyTubes, default_poses: Callable[[Array, Array, Array], Array],
    handled: tuple[Span, ...],
) -> EditingSummary:  # fmt: skip
    """Measure the part of a run before the curve is performed; arguments as for `results.measures.summarise`."""
    span = (0.0, tubes.until)
    path, animation, figure, _ = measure_span(recording, default_poses, span, handled)
    last = float(recording.channel("ticks", "t")[-1])
    presses = press_summaries(recording, tubes.curve, tubes.epsilon, tubes.until)
    until = tubes.until if np.isfinite(tubes.until) else None
    return EditingSummary(min(last, tubes.until), until, presses, path.pushes, animation, figure)


def performance_summary(
    recording: Recording, tubes: StretchyTubes, default_poses: Callable[[Array, Array, Array], Array],
    handled: tuple[Span, ...],
) -> PerformanceSummary | None:  # fmt: skip
    """Measure the part in which the curve is performed; None if the run has no such part or ended before it."""
    last = float(recording.channel("ticks", "t")[-1])
    if last <= tubes.until:
        return None
    path, animation, figure, _ = measure_span(recording, default_poses, (tubes.until, np.inf), handled)
    return PerformanceSummary(tubes.until, last - tubes.until, path, animation, figure)


def press_summaries(
    recording: Recording, curve: Trajectory, epsilon: float, until: float = np.inf
) -> tuple[PressSummary, ...]:
    """What was done at each press of the switch before the time `until`, by the same rules as the law's.

    Parameters
    ----------
    recording : Recording
        Recording with the channels t, p, switch, user, phase, nearest and distance in the group ``ticks``.
    curve : Trajectory
        The unedited curve.
    epsilon : float
        Radius of its tube [m].
    until : float
        End of the editing [s].
    """
    ticks = recording.groups["ticks"]
    presses: list[PressSummary] = []
    done = taken_back = 0
    for first, end in _press_intervals(ticks["switch"], ticks["t"], until):
        press = _press_summary(
            {name: ticks[name][max(first - 1, 0) : end] for name in _PRESS_CHANNELS}, curve, epsilon, first > 0
        )
        if press.what in ("held", "pushed"):
            done, taken_back = done + 1, 0
        elif press.what in ("undo", "redo"):
            step = -1 if press.what == "undo" else 1
            if (done if step < 0 else taken_back) == 0:
                press = replace(press, what="nothing")
            else:
                done, taken_back = done + step, taken_back - step
        presses.append(press)
    return tuple(presses)


def _press_intervals(switch: Channel, t: Channel, until: float) -> list[tuple[int, int]]:
    """First tick of every press, and the first tick after it."""
    edges: list[int] = []
    pressed = False
    for first in range(0, len(switch), ROWS):
        down = (switch[first : first + ROWS] > 0.5) & (t[first : first + ROWS] < until)
        edges.extend(int(edge) + first for edge in np.flatnonzero(np.diff(down, prepend=pressed)))
        pressed = bool(down[-1])
    if len(edges) % 2:
        edges.append(len(switch))
    return list(zip(edges[::2], edges[1::2], strict=True))


def _press_summary(ticks: dict[str, Array], curve: Trajectory, epsilon: float, before: bool) -> PressSummary:
    """Summary of one press; if `before`, the first row is the tick before the press."""
    k = int(before)
    t, p, phase, nearest = ticks["t"][k:], ticks["p"][k:], ticks["phase"][k:], ticks["nearest"]
    seconds = float(2.0 * t[-1] - t[0] - ticks["t"][len(ticks["t"]) - 2]) if len(ticks["t"]) > 1 else 0.0
    force = float(np.linalg.norm(ticks["user"][k:], axis=1).max())
    lap, since = float((phase[-1] - curve.start) / curve.duration), 0
    what = _press_kind(p, seconds, ticks["distance"][k], epsilon)
    if what == "pushed":
        changes = np.flatnonzero(np.diff(phase))
        since = k + int(changes[-1]) if len(changes) else 0
        # While a tube is pushed, the phase stays and the point moves; if the point stays too, the tube was not touched.
        if np.all(nearest[since + 1 :] == nearest[-1]):
            what = "nothing"
    if what not in ("held", "pushed"):
        return PressSummary(float(t[0]), seconds, what, None, 0.0, 0.0, force)
    dragged = float(np.linalg.norm(nearest[-1] - nearest[since]))
    deviation = float(np.linalg.norm(nearest[-1] - curve.point(float(phase[-1]))))
    return PressSummary(float(t[0]), seconds, what, lap, 1e3 * dragged, 1e3 * deviation, force)


def _press_kind(p: Array, seconds: float, distance: float, epsilon: float) -> PressKind:
    """Kind of a press, from the stylus path, the duration [s] and the initial distance from the curve [m]."""
    if distance > epsilon:
        return "pushed"
    if np.linalg.norm(p - p[0], axis=1).max() < CLICK_DISTANCE:
        return "undo" if seconds < CLICK_TIME else "redo"
    return "held" if distance < _MAX_HELD_DISTANCE else "nothing"
