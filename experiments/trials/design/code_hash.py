"""Hash of the code that determines a trial's measures; part of the key of a trial."""

import hashlib
import sys
from functools import cache
from importlib.metadata import version

from sim.compilation.sources import reached_code

_TRIAL_MODULE = "experiments.trials.trial.run_trial"
_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "llvmlite")


@cache
def code_hash() -> str:
    """Hash of the code that a trial reaches, and of the versions of Python and the libraries, 16 hex digits.

    Analysis and plots of a study are not included; nor is the processor, which a row names separately.
    """
    parts = [sys.version_info[:2], [version(name) for name in _LIBRARIES], sorted(reached_code(_TRIAL_MODULE).items())]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
