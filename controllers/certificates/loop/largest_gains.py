"""Largest gains of a law: configurations accept no larger ones, and certificates search no further."""

MAX_STIFFNESS, MAX_DAMPING = 1e6, 1e4
"""[N/m], [N s/m]: beyond any device, and beyond any hand."""
