"""One trial: its run, the channels kept of it, and its measures."""
