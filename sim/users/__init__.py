"""Simulated users: an arm that acts on the stylus and knows nothing of the field."""
