"""The reference: desired pose, velocity and acceleration of the body, from the motion of the stylus."""
