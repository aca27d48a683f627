"""Real devices: running one, and finding out what it is."""
