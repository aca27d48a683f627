"""Haptic maps: from stylus poses to configurations of a figure or a robot arm."""
