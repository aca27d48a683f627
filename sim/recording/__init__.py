"""Recordings of runs: writing while a run goes on, and reading."""
