"""Flights of clips: certified, flown by the physical figure, and repaired."""
