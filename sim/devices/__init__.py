"""Devices that the loop runs with: the simulated Phantom, a replayed hand, and real ones by their drivers."""
