"""The simulated world: MuJoCo's model and state, the Phantom's encoders and motors, the user's hand on the stylus."""
