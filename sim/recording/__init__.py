"""Recordings: written tick by tick, and read."""
