"""Certificates of flights and turns of a motion, and their repair."""
