"""Devices: the simulated Phantom, a replayed recording, real hardware. One protocol for all."""
