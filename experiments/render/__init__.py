"""Pictures and films of a run, drawn by MuJoCo from its recording."""
