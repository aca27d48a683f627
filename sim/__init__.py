"""The simulation: servo loop, world, devices, users, figure control, recorder, viewer."""
