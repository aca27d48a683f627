"""Fitting a map to the physical figure before a run: balance, choice of legs, feasible changes, cached verdicts."""
