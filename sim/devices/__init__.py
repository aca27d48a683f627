"""Haptic devices for the servo loop: the simulated Phantom, a replayed hand, and drivers of real devices."""
