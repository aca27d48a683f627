"""Real devices: which there are, whether this machine can drive one, running one, and finding out what it is."""
