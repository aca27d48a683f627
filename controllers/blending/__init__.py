"""Blends of time-aligned motions: weighted mean poses and their derivatives."""
