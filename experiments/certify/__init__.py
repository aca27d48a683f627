"""Certificates of the fields of runs, of simulations and of clips, written to folders."""
