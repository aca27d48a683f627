"""A real device in the loop: the servo's process, what stands beside it, the twin, and what a device is found to be."""
