"""One file a mode: the parts of a run, made from its configuration and its map."""
