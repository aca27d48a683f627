"""Physical constants of the world in which figures move."""

GRAVITY = 9.81
"""Acceleration of free fall, g [m/s²]: MuJoCo's default. The standard value is 9.80665 m/s² (3rd CGPM, 1901)."""

FRICTION = 0.9
"""Coefficient of friction μ of a sole on the floor, as of rubber on a dry one (models/humanoid/README.md)."""
