"""Curves in the space of stylus poses: splines, closest point, branches, deformation."""
