"""Models: the Phantom, the figure, motion capture, and the world they share. No control, no loop."""
