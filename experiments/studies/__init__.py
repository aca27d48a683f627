"""Experiments that could refute a claim, and the pictures of the docs."""
