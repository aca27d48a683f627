"""The servo loop, run in blocks of ticks."""
