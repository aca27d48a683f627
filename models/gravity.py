"""Gravity; `controllers.gravity` defines it too, since neither package imports the other."""

GRAVITY = 9.81
"""Acceleration of free fall, g [m/s²]: MuJoCo's default. The standard value is 9.80665 m/s² (3rd CGPM, 1901)."""
