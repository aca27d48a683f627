"""``python -m experiments``: the ``hvf`` command."""

import sys

from experiments.cli import main

sys.exit(main())
