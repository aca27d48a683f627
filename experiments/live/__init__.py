"""The live page, on which a person takes the stylus: engine process, state and actions, panels, access gate."""
