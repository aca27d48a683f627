"""Certificates of crossing rivers: which one keeps the hand, and how often that can change."""
