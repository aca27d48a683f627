"""Bounds of a well-formed clip, and the text of a measure that exceeds one. Without slow imports."""

import numpy as np

# Heights of soles in stance [m]; the preparation's prototype left a penetration of 3 mm.
LOWEST, HIGHEST = -0.003, 0.005
FLATTEST = np.deg2rad(2.0)  # largest tilt of soles in stance
SKATE = 0.005  # foot skate in a stance [m]
# RMS residual force [body weights]. For gaits and gestures, the bound of Hicks et al. (2015); for motions with flights,
# the residual that the preparation's prototype left in fighting and jumping jacks (11 and 12 %).
RESIDUAL, FLYING = 0.05, 0.12
SEAM = 0.3  # difference of the velocities at a closed clip's ends [rad/s, m/s]
REST = 0.3  # RMS joint velocity at an open clip's ends [rad/s]
LIMIT = np.deg2rad(1.0)  # excess over a joint's range: Euler angles and rotation vectors differ by as much near limits
FLIGHT = 1.5  # RMS difference of the centre of mass' acceleration from gravity in flight [m/s²]


def beyond(measure: float, bound: float) -> str:
    """A measure greater than its bound as text, with as many decimals (at least one) as distinguish the two."""
    texts = (f"{measure:.{digits}f}" for digits in range(1, 17))
    return next((text for text in texts if float(text) > bound), str(measure))
