"""What a motion asks of the floor and of gravity."""
