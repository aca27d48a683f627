"""The world as it is stepped: MuJoCo's model and state, the Phantom's wires, the hand on the stylus."""
