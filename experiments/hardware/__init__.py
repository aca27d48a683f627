"""Real devices: which there are, and whether this machine can drive one."""
