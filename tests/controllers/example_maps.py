"""Maps of clips that several tests examine: on a cylinder, composite and lifted."""

import numpy as np

from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical, LegsOfOneClip
from controllers.haptic_map.lifted import Lifted
from controllers.legs.limbs import Limb
from tests.controllers.clips_for_maps import LEG, swinging

R, Z = (0.03, 0.07), (-0.03, 0.03)
CORNERS = [(R[0], Z[0]), (R[1], Z[0]), (R[0], Z[1]), (R[1], Z[1])]
CLIPS = [(swinging(1, 120), 30.0), (swinging(2, 90), 30.0), (swinging(3, 150), 60.0), (swinging(4, 120), 30.0)]
CYLINDRICAL = Cylindrical(
    [
        (swinging(1, travel=1.3), 30.0),
        (swinging(2, travel=0.7), 30.0),
        (swinging(3, turns=1.0), 30.0),
        (swinging(4, travel=0.5, turns=-0.1), 30.0),
    ],
    R,
    Z,
    [LEG],
)
CYLINDRICAL_ARMS = Cylindrical(CLIPS, R, Z, legs=LegsOfOneClip(2, (3,))).with_share(0.5)

LOWER, RED, BLUE = (
    (swinging(1, travel=1.2), 30.0),
    (swinging(2, 90, travel=0.3, turns=1.0), 30.0),
    (swinging(3, 150), 60.0),
)
COMPOSITE = Composite(LOWER, RED, BLUE, (3,), R)
LOWER_LEG = Limb((1, 2, 3), LEG.offsets, LEG.axis, LEG.points)
FOUR_JOINTS = [(np.hstack([poses, swinging(9, len(poses) - 1)[:, 7:11]]), fps) for poses, fps in (LOWER, RED, BLUE)]
COMPOSITE_WITH_LEGS = Composite(*FOUR_JOINTS, (4,), R, [LOWER_LEG]).with_share(0.6)

ROWS = 48
TURN = 2.0 * np.pi


def ring(m, radius=0.012, centre=(0.05, 0.0)):
    """Sites of m curves that wind round a circle of the half plane, shape (rows, m, 2)."""
    lap = np.arange(ROWS)[:, None] * TURN / ROWS
    around = np.arange(m) * TURN / m + 0.3 * np.sin(lap)
    size = radius * (1.0 + 0.15 * np.cos(2.0 * lap))
    return np.stack([centre[0] + size * np.cos(around), centre[1] + size * np.sin(around)], axis=-1)


def angles_once_round(frames, start=0.0, span=TURN, unevenness=0.25):
    """Angles of frames: increasing, at an uneven pace."""
    s = np.linspace(0.0, 1.0, frames)
    return start + span * (s + unevenness * np.sin(TURN * s) / TURN)


# A walk, a clip on the spot, a turn, and an open part of a clip.
LIFTED_CLIPS = [
    (swinging(1, 120, travel=1.3), 30.0),
    (swinging(2, 90), 25.0),
    (swinging(3, 150, turns=1.0), 60.0),
    (swinging(6, 200)[:140], 30.0),
]
CLOSED = [True, True, True, False]
ANGLES = [
    angles_once_round(121),
    angles_once_round(91, 1.2),
    angles_once_round(151, 4.0),
    angles_once_round(140, 0.3, TURN - 0.9),
]
LIFTED = Lifted(LIFTED_CLIPS, CLOSED, ANGLES, ring(4), [LEG], ("walk", "still", "turn", "cut"))
WITHOUT_LIMBS = Lifted(LIFTED_CLIPS, CLOSED, ANGLES, ring(4), (), ("walk", "still", "turn", "cut"))
ARM_JOINTS = [2, 3]
