"""Lifting: curves in the device's workspace and one haptic map, made from clips alone."""
