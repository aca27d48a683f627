"""Models: the Phantom, the figure, motion capture, a robot arm, and the MuJoCo world. No control, no loop."""
