"""Experiments that could refute a claim, benchmarks, and the pictures of the docs."""
