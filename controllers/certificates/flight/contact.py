r"""Plausibility of contacts: whether the support of a motion between its flights can be real contact with the floor.

Contacts are detected leniently, since feet in captures often hover: a slow foot 5 cm above the floor counts as support.
That is enough to find flights, but does not prove contact. So a certificate also requires the following:

- the floor level, the median height of the body's lowest point while supported, is near z = 0;
- for 90 % of the supported time that point is within a tolerance of the floor level, above and below;
- some contact is at rest most of the time, and no resting contact skates far: friction does not hold a gliding body;
- the centre of mass accelerates no more than legs can push; with d the noise of the recorded centre of mass,

.. math:: |\ddot c| \le a_{max} + 4 d f^2, \quad \ddot c \text{ by second differences at } f \text{ frames a second};

- no joint turns in one frame by many times as much as in the frames before and after it.
"""

from dataclasses import dataclass

import numpy as np

from controllers.certificates.flight.flight_fit import COM_NOISE
from controllers.certificates.flight.tolerance import ContactTolerance
from geometry.arrays import Array, Mask
from geometry.spans import spans


@dataclass(frozen=True, eq=False)
class BodyContact:
    """Contacts with the floor in n frames, and joint rotations between frames.

    Parameters
    ----------
    lowest : array, shape (n,)
        Height of the lowest point of the body over the floor [m].
    supported, held : array of bool, shape (n,)
        Whether any contact bears load, and whether any of these contacts is at rest.
    skate : float
        Largest distance of a foot's contact point from its median place while it counts as at rest [m].
    turned : array, shape (n − 1,)
        Largest rotation of a joint from frame to frame [rad].
    """

    lowest: Array
    supported: Mask
    held: Mask
    skate: float
    turned: Array


def contact_doubts(
    touched: BodyContact, com: Array, fps: float, tolerance: ContactTolerance
) -> tuple[list[str], dict[str, object]]:
    """Reasons to doubt that the support is contact, as clauses, and measures; com: centre of mass (n, 3) [m]."""
    doubts: list[str] = []
    figures: dict[str, object] = {}
    if touched.supported.any():
        heights = touched.lowest[touched.supported]
        floor = float(np.median(heights))
        low, high = (float(end) for end in np.quantile(heights, (0.05, 0.95)) - floor)
        figures |= {"floor": floor, "lowest": low, "highest": high}
        if abs(floor) > tolerance.floor:
            where = "over" if floor > 0.0 else "under"
            doubts.append(f"stands {1e3 * abs(floor):.0f} mm {where} the floor, more than {1e3 * tolerance.floor:g}")
        if max(-low, high) > tolerance.spread:
            doubts.append(
                f"its lowest point is {1e3 * low:.0f} to {1e3 * high:+.0f} mm from where it stands, beyond "
                f"±{1e3 * tolerance.spread:g}"
            )
    unheld = max((end - start for start, end in spans(touched.supported & ~touched.held)), default=0) / fps
    figures |= {"unheld": unheld, "skate": touched.skate}
    if unheld > tolerance.unheld:
        doubts.append(f"for {unheld:.2f} s it is near the floor with no part at rest, longer than {tolerance.unheld:g}")
    if touched.skate > tolerance.skate:
        doubts.append(f"a foot that stands skates by {100 * touched.skate:.2f} cm, more than {100 * tolerance.skate:g}")
    return doubts + _jump_doubts(touched, com, fps, tolerance, figures), figures


def _jump_doubts(
    touched: BodyContact, com: Array, fps: float, tolerance: ContactTolerance, figures: dict[str, object]
) -> list[str]:
    doubts: list[str] = []
    if len(com) > 2:
        size = np.linalg.norm(np.diff(com, 2, axis=0), axis=1) * fps**2
        at, limit = int(np.argmax(size)), tolerance.push + 4.0 * COM_NOISE * fps**2
        figures["jump"] = float(size[at])
        if size[at] > limit:
            doubts.append(
                f"jumps at {(at + 1) / fps:.2f} s: its centre of mass accelerates by {size[at]:.0f} m/s², more than "
                f"{limit:.0f}"
            )
    turned = touched.turned
    if len(turned) > 2:
        around = np.maximum(turned[:-2], turned[2:])
        leaps = (turned[1:-1] > tolerance.leap) & (turned[1:-1] > tolerance.outlier * around)
        if leaps.any():
            at = int(np.argmax(leaps)) + 1
            doubts.append(f"a joint leaps by {np.rad2deg(turned[at]):.0f}° in one frame, at {(at + 1) / fps:.2f} s")
    return doubts
