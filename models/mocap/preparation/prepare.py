"""Pipeline from a motion file to a well-formed clip.

Load, correct the pace, loop, shift the root so that supporting feet rest, low-pass, detect stances, optimise.
"""

from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from models.errors import ModelError
from models.humanoid.skeleton import HAND_CONTACTS
from models.mocap.library import Loaded, load
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import contact_points
from models.mocap.preparation.attempt import Attempt, attempt, unchanged
from models.mocap.preparation.closing_frame import with_closing_frame
from models.mocap.preparation.fidelity import Fidelity, fidelity
from models.mocap.preparation.looping import LoopedClip, close_or_rest
from models.mocap.preparation.pace import Paced, correct_pace
from models.mocap.preparation.poses import resampled, smoothed
from models.mocap.preparation.stances import Stances
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.retarget_report import MIN_FRAME_RATE, RetargetReport, two_digits
from models.one_blas_thread import on_one_blas_thread

FPS = 120.0  # frame rate of prepared clips [1/s], as CMU's: slower captures need it for the detail that is added
_MAX_DURATION = 120.0  # [s]: longer captures were not tried; of a cyclic one, a single lap is prepared
_CLOSING_REMARK = (
    "the motion goes on from its last frame to its first, as a lap without its closing frame: it is appended"
)


class HandLoad(NamedTuple):
    """Hands that bear load in a prepared clip.

    Attributes
    ----------
    seconds : float
        Time in which a hand bears load [s].
    moved : float
        Largest distance between a load-bearing palm in the capture and its place on the floor [m].
    """

    seconds: float
    moved: float


class Prepared(NamedTuple):
    """A capture and the well-formed clip made of it.

    Attributes
    ----------
    clip : Clip
        The result.
    captured : Clip
        The capture as retargeted to the figure and put on the floor, with the closing frame of a lap that lacks it.
    report : RetargetReport or None
        How the file was interpreted; None for a file on the figure's own skeleton.
    paced : Paced
        Result of the pace correction.
    root_shift : float
        Largest displacement of the root over the floor that keeps a supporting foot from sliding (`root_path`) [m].
    hands : HandLoad
        How long hands bear load, and how far their palms were moved to the floor; zeros if not `near`.
    attempt : Attempt
        The feasible motion, and its distance from the looped capture.
    fidelity : Fidelity
        Distance of the clip from the capture.
    seconds : float
        Processor time [s].
    """

    clip: Clip
    captured: Clip
    report: RetargetReport | None
    paced: Paced
    root_shift: float
    hands: HandLoad
    attempt: Attempt
    fidelity: Fidelity
    seconds: float

    @property
    def looped(self) -> LoopedClip:
        """The capture looped, before optimisation."""
        return self.attempt.cycle

    @property
    def near(self) -> bool:
        """Whether a feasible motion was found near the capture.

        If not, as where flights are not ballistic at the file's rate, `clip` is only the looped and low-passed capture,
        and its measures show the faults.
        """
        return self.attempt.near


@on_one_blas_thread
def prepared(path: Path, loop: str = "auto", mirror: bool = False, hints: Hints | None = None) -> Prepared:
    """Make a well-formed clip of the motion in a file; one on the figure's own skeleton that is so already stays.

    Parameters
    ----------
    path : Path
        File in one of the readable `formats`.
    loop : str
        ``auto``, ``open``, or ``START:END`` of the cycle, in seconds from the first frame that is kept.
    mirror : bool
        Continue half a stride, or START:END, by its mirror image.
    hints : Hints or None
        Facts about the file that the user states.

    Raises
    ------
    MotionFileError
        If the file cannot be read, or contradicts itself.
    ModelError
        If the motion has a single frame, lasts less than two frames at 120 Hz, or longer than two minutes because of a
        coarse frame rate, if the part that is used lasts longer than that, or if the loop is not within the motion.
    """
    began = process_time()
    loaded = load(path, hints)
    captured, report = _completed(loaded) if loop in ("auto", "lap") else (loaded.clip, loaded.report)
    if captured.n_frames < 2:
        raise ModelError(f"{path}: a single frame; expected a motion of two frames to {_MAX_DURATION:.0f} s")
    if captured.fps < MIN_FRAME_RATE and captured.duration > _MAX_DURATION:
        what = f"lasts {captured.duration:.0f} s, since a frame lasts {two_digits(1.0 / captured.fps)} s"
        raise ModelError(f"{path}: {what}; expected a Frame Time in seconds, such as {1.0 / 30.0:.4f}, or --frame-rate")
    timed = correct_pace(resampled(captured, FPS))
    even_clip = resampled(timed.clip, FPS)
    if even_clip.n_frames < 2:
        frames = f"{captured.n_frames} frames that last {two_digits(captured.duration)} s"
        raise ModelError(
            f"{path}: {frames}; expected 1/{FPS:g} s at least: a Frame Time in seconds, such as {1.0 / 30.0:.4f}, or "
            "--frame-rate"
        )
    kept = unchanged(even_clip) if report is None and loop == "auto" and not mirror else None
    tried = kept or _nearest(path, even_clip, loop, loaded.loops, mirror)
    cycle, near = tried.cycle, tried.near
    carried = float(np.linalg.norm((tried.planted.poses - cycle.clip.poses)[:, :2], axis=1).max()) if near else 0.0
    chosen = tried.clip if near else smoothed(cycle.clip)
    clip = Clip(chosen.poses, chosen.fps, captured.name)
    distance = fidelity(clip, captured, cycle, timed.pace)
    bears = near and tried.schedule.hands.any()
    hands = _hand_load(tried.planted, tried.schedule) if bears else HandLoad(0.0, 0.0)
    return Prepared(clip, captured, report, timed, carried, hands, tried, distance, process_time() - began)


def _completed(loaded: Loaded) -> tuple[Clip, RetargetReport | None]:
    """A capture, with the closing frame of a lap that lacks it, and how it was interpreted."""
    captured, report = loaded.clip, loaded.report
    if report is None or (completed := with_closing_frame(captured)) is captured:
        return captured, report
    return completed, report._replace(remarks=(*report.remarks, _CLOSING_REMARK))


def _nearest(path: Path, clip: Clip, loop: str, wraps: bool | None, mirror: bool) -> Attempt:
    """The capture looped and made feasible."""
    tried = _attempt(path, close_or_rest(clip, loop, wraps, mirror), clip)
    # A decay if no last step is feasible nearby. Joints stop within their ranges only if needed: otherwise a backflip
    # has a residual of 27 % instead of 8 %.
    for ending in ("decay", "limited decay"):
        if tried.near or tried.cycle.kind != "open":
            break
        cycle = close_or_rest(clip, loop, wraps, mirror, ending)
        if not np.array_equal(cycle.clip.poses, tried.cycle.clip.poses):
            tried = _attempt(path, cycle, clip)
    return tried


def _attempt(path: Path, cycle: LoopedClip, captured: Clip) -> Attempt:
    """Make a looped clip feasible, unless it is too long."""
    if (lasts := cycle.clip.duration) > _MAX_DURATION:
        which = {"cycle": "its cycle", "half stride": "its stride", "way back": "it, with the way back,"}
        what = f"{which.get(cycle.kind, 'it, at rest at both ends,')} lasts {lasts:.2f} s"
        part = "or a part of it by `hvf prepare --loop START:END`"
        raise ModelError(f"{path}: {what}; expected at most {_MAX_DURATION:.0f} s, {part}")
    return attempt(cycle, captured, FPS)


def _hand_load(clip: Clip, schedule: Stances) -> HandLoad:
    """Load on the hands in a clip, by its contact schedule."""
    bearing = schedule.hands
    offsets = contact_points(clip.poses, HAND_CONTACTS) - schedule.places[:, -bearing.shape[1] :]
    return HandLoad(float(bearing.any(axis=1).sum()) / clip.fps, float(np.linalg.norm(offsets, axis=2)[bearing].max()))
