"""Motions as functions of time, whatever they drive: loops, means, changes from one to another."""
