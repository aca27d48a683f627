"""Figures 1 to 8 of Donald & Henle (2000), drawn from recordings of runs of this program."""
