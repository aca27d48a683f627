"""Figures and pages of a run, drawn from its recording."""
