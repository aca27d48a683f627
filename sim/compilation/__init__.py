"""Compilation of kernels by numba: compilation units, their cache on disk, calls by address, MuJoCo's C functions."""
