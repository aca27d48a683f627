"""Certificates of a region of attraction about a curve: Lyapunov functions checked by interval bounds."""
