"""Preparation of captures: ``hvf prepare``, its report, and cached prepared clips for runs."""
