"""Tools of the source tree, which are not installed."""
