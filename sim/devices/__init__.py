"""Devices that the loop runs with: the simulated Phantom, a replayed hand, and a driver behind two arrays."""
