"""Certificates of a region about a curve: Lyapunov functions checked by interval bounds."""
