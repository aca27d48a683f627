"""How much of a recording is read at a time, so that measures take constant memory: about a megabyte."""

ROWS = 100_000  # ticks of a channel of single numbers
BLOCK_ROWS = 16_000  # ticks of several channels of vectors
BLOCK_FRAMES = 2000  # poses of the figure
