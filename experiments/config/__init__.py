"""Configurations: pure data, from which the command line is made."""
