"""From a capture on the figure to a well-formed clip: at rest or closed, on the floor, feasible on contact alone."""
