"""Captures made well-formed: the command, its report, and the door for runs."""
