"""A seven-joint robot arm of spherical shoulder, elbow and spherical wrist."""
