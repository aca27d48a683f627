"""When the program began, for the time until a first tick. Imported first."""

import os
import time

STARTED = time.perf_counter()
"""[s], of `time.perf_counter`."""
# The matrices here are small: more threads only get into each other's way. Read by NumPy when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
