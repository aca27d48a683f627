"""Export of the figure's animation for other programs."""
