"""The MuJoCo world: the Phantom on its table, and the figure or a robot arm on the floor."""
