"""Motions of the figure: clips, arithmetic of their quaternions, ranges of joints."""
