"""Haptic maps: every stylus pose is a pose of something with many joints."""
