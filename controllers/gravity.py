"""Gravity; `models.gravity` defines it too, since neither package imports the other."""

GRAVITY = 9.81
"""Acceleration of free fall, g [m/s²]: that of the models, which is MuJoCo's default."""
