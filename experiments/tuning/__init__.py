"""Tuning of any parameters of a run, by how simulated people perform with them, among certified values only."""
