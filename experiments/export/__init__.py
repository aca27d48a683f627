"""The figure's animation for other programs."""
