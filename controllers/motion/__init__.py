"""Motions as functions of time: loops, means, in-betweens, and transitions from one motion to another."""
