"""Bounds of a well-formed clip, and how a measure beyond one is written. Without imports that take long."""

import numpy as np

LOWEST, HIGHEST = -0.003, 0.005  # heights of soles in stance [m]; the prototype of preparation left 3 mm of penetration
FLATTEST = np.deg2rad(2.0)  # largest tilt of soles in stance
SKATE = 0.005  # [m] in a stance
# RMS residual force [body weights]: of gaits and gestures, the bound of Hicks et al. (2015); of motions with flights,
# what the prototype of preparation left to fighting and jumping jacks (11 and 12 %).
RESIDUAL, FLYING = 0.05, 0.12
SEAM = 0.3  # difference of the velocities at a closed clip's ends [rad/s, m/s]
REST = 0.3  # RMS joint velocity at an open clip's ends [rad/s]
LIMIT = np.deg2rad(1.0)  # excess over a joint's range: Euler angles and rotation vectors differ by as much near limits
FLIGHT = 1.5  # RMS difference of the centre of mass' acceleration from gravity in flight [m/s²]


def beyond(measure: float, bound: float) -> str:
    """A measure greater than its bound, with as many decimals, one or more, as tell the two apart."""
    texts = (f"{measure:.{digits}f}" for digits in range(1, 17))
    return next((text for text in texts if float(text) > bound), str(measure))
