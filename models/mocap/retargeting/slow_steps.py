r"""Steps that are too slow for their length, as where the stated frame rate is a fraction of that of the recording.

Whatever their speed, people walk with about the same ratio of step length to cadence (Sekiya & Nagasaki 1998,
"Reproducibility of the walking patterns of normal young adults"). In units of the leg's length l

.. math:: W = \frac{L}{l}\,T\,\sqrt{g/l}

with the length L and the time T of a step. A motion in slow motion has a larger one by its factor f. People also pause
between steps: only steps at an even pace count. They skip, with a hop in every step; but in slow motion a body falls
with g/f² at most.
"""

from collections.abc import Iterator

import numpy as np

from geometry.arrays import Array
from geometry.physics import GRAVITY
from geometry.quaternions import unit
from geometry.spans import spans
from models.mocap.retargeting.retarget_report import two_digits

_USUAL_RATIO = 1.5  # W of walks, runs have up to 1.8
# Least of W over consecutive steps, and their number, from which a remark is made. Four recordings that are stated to
# be 4 or 5 times slower have 5.0 to 6.6; of 110 other captures a tired walk has 3.1, and all others at most 2.1. Four
# more such recordings are remarked on, and none of 45 styled gaits and some 350 other captures.
_MAX_RATIO, _MIN_STEPS = 4.0, 3
_MIN_ASTRIDE = 0.15  # distance between the ankles along the hips' heading from which one foot is ahead [leg lengths]
_MIN_STEP = 0.3  # least length of a step [leg lengths]
# Downward acceleration of the hips above which a body is not in slow motion [g], and the time over which it is a mean
# [s]: at the least factor that is remarked on, a flight has 0.14.
_MAX_FALL, _FALL_TIME = 0.33, 0.2
_MIN_EVENNESS = 0.6  # least distance covered in a quarter of a step, as a fraction of the mean of its quarters


def slow_step_remarks(path: Array, legs: Array, ankles: Array, leg: float, fps: float) -> Iterator[str]:
    """Consecutive steps at an even pace that take several times as long as people's.

    Parameters
    ----------
    path : array of shape (n, 3)
        Middle of the hips [m].
    legs, ankles : array of shape (n, 2, 3)
        The ankles relative to their hips, and to the middle of the hips [m].
    leg : float
        Length of the leg [m].
    fps : float
        Frame rate [1/s].
    """
    left = np.diff(legs - ankles, axis=1)[:, 0]
    ahead = unit(np.column_stack((left[:, 1], -left[:, 0])))
    astride = np.sum((ankles[:, 0] - ankles[:, 1])[:, :2] * ahead, axis=1)
    side = np.where(np.abs(astride) > _MIN_ASTRIDE * leg, np.sign(astride), 0.0)
    apart = np.flatnonzero(side)
    passing = apart[1:][side[apart[1:]] != side[apart[:-1]]]
    if len(passing) <= _MIN_STEPS:
        return
    quarters = np.linspace(passing[:-1], passing[1:], 5).round().astype(int)
    covered = np.linalg.norm(np.diff(path[quarters, :2], axis=0), axis=2)
    lengths = np.linalg.norm(path[passing[1:], :2] - path[passing[:-1], :2], axis=1)
    times = np.diff(passing) / fps
    ratios = lengths * times / (leg * np.sqrt(leg / GRAVITY))
    even = (covered.min(axis=0) > _MIN_EVENNESS * covered.mean(axis=0)) & (lengths > _MIN_STEP * leg)
    runs = [slice(*run) for run in spans(even & (ratios > _MAX_RATIO)) if run[1] - run[0] >= _MIN_STEPS]
    falls = _falls(path[:, 2], fps) if runs else np.zeros(0)
    slow = [run for run in runs if falls[passing[run.start] : passing[run.stop]].max() < _MAX_FALL * GRAVITY]
    if slow:
        length, time, ratio = (
            float(np.median(np.concatenate([values[run] for run in slow]))) for values in (lengths, times, ratios)
        )
        factor = ratio / _USUAL_RATIO
        remark = f"steps of {length:.2f} m take {time:.1f} s each at an even pace, {factor:.0f} times a person's time"
        yield f"{remark}: if {fps:g} frames a second are wrong, give --frame-rate, such as {two_digits(fps * factor)}"


def _falls(heights: Array, fps: float) -> Array:
    """Downward accelerations [m/s²], by parabolas over `_FALL_TIME` or five frames; zeros if there are fewer."""
    from scipy.signal import savgol_filter  # imported late: it loads scipy.stats, which is slow

    width = 2 * round(max(_FALL_TIME * fps, 4.0) / 2.0) + 1
    if len(heights) < width:
        return np.zeros(len(heights))
    return np.asarray(-savgol_filter(heights, width, 2, deriv=2, delta=1.0 / fps))
