"""Bounds of a well-formed clip, and the text of a measure that exceeds one. Without slow imports."""

import numpy as np

# Heights of soles in stance [m]; the preparation's prototype left a penetration of 3 mm.
MIN_SOLE_HEIGHT, MAX_SOLE_HEIGHT = -0.003, 0.005
MAX_SOLE_TILT = np.deg2rad(2.0)  # of soles in stance
# Depth of any sole at any time [m]: those that swing are the lower by low-pass filtering, up to 6 mm in 50 clips.
MAX_SOLE_DEPTH = 0.01
MAX_SKATE = 0.005  # foot skate in a stance [m]
# Slide of a foot within 3 mm of the floor, loaded or not [m], as in a change of river. Toes that leave the floor brush
# over it by up to 27 mm; a foot that jumped across a seam slid by 94 mm or more.
MAX_SLIDE = 0.03
# RMS residual force [body weights]. For gaits and gestures, the bound of Hicks et al. (2015); for motions with flights,
# the residual that the preparation's prototype left in fighting and jumping jacks (11 and 12 %).
MAX_RESIDUAL, MAX_RESIDUAL_IN_FLIGHTS = 0.05, 0.12
MAX_SEAM_VELOCITY_JUMP = 0.3  # difference of the velocities at a closed clip's ends [rad/s, m/s]
MAX_END_SPEED = 0.3  # RMS joint velocity at an open clip's ends [rad/s]
MAX_LIMIT_EXCESS = np.deg2rad(1.0)  # over a joint's range: Euler angles and rotation vectors differ by this near limits
# How much deeper parts of the body may be in each other than in the capture [m], half the radius of an ankle. Arms that
# hang, or hands on hips, are up to 9 cm deep in captures: the figure has one girth.
MAX_ADDED_DEPTH = 0.02
MAX_FLIGHT_ACCELERATION_ERROR = 1.5  # RMS difference of the centre of mass' acceleration from gravity in flight [m/s²]


def exceeding_text(measure: float, bound: float) -> str:
    """A measure greater than its bound as text, with as many decimals (at least one) as distinguish the two."""
    texts = (f"{measure:.{digits}f}" for digits in range(1, 17))
    return next((text for text in texts if float(text) > bound), str(measure))
