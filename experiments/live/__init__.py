"""The live page, on which a person holds the stylus: engine process, state and actions, panels, access gate."""
