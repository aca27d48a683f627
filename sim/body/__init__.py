"""What follows the reference: the physical figure, or a robot arm."""
