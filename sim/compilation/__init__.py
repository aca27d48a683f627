"""Compiled kernels: their cache, their addresses, and MuJoCo's functions for them."""
