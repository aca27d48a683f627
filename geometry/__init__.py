"""Rotations, smooth steps, array types and physical constants, for models and controllers alike; imports neither."""
