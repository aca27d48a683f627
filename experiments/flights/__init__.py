"""Flights of clips: judged, flown by the physical figure, repaired."""
