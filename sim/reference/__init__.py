"""From the stylus to the pose, velocity and acceleration that the body is to follow."""
