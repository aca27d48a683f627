"""Certificates of switching between crossing rivers: whether the active river keeps the hand, and dwell times."""
