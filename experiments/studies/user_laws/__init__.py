"""Simulated people compared with published laws of human movement, on a device without a field."""
