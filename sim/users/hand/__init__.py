"""A simulated hand: the impedance of an arm, its scripted actions, fingers that turn the stylus."""
