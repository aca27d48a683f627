"""Simulated users at the stylus, who know nothing of the force field: a simple arm, and a person with senses."""
