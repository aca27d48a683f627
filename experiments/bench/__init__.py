"""Benchmarks of `hvf bench`: speed, as ratios within one run."""
