"""Bodies that track the reference: the physical figure, or a robot arm, and their control."""
