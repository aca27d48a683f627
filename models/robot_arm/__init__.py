"""A seven-joint (S-R-S) robot arm: spherical shoulder, revolute elbow, spherical wrist."""
