"""Lifting: from clips alone to curves in the device's workspace and one map."""
