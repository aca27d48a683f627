"""Certificates of crossing rivers: who keeps the hand, and how often that can change."""
