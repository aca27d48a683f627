"""Curves in the space of stylus poses, and the closest point on them."""
