"""Blends of aligned motions: one pose of several, and its derivative."""
