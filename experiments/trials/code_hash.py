"""Hash of the code that determines a trial's measures; part of the key of a trial."""

import hashlib
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_SOURCES = (
    "models", "controllers", "sim", "experiments/config", "experiments/setups", "experiments/files",
    "experiments/results",
)  # fmt: skip
_OF_TRIALS = ("code_hash.py", "measures.py", "run_trial.py", "trial_log.py")
_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "llvmlite")


@cache
def code_hash() -> str:
    """Hash of the sources of runs and measures, and of the versions of Python and the libraries, 16 hex digits.

    Analysis and plots of a study are not included; nor is the processor, which a row names separately.
    """
    digest = hashlib.sha256(f"{sys.version_info[:2]} {[version(name) for name in _LIBRARIES]}".encode())
    files = [path for folder in _SOURCES for path in sorted((_ROOT / folder).rglob("*.py"))]
    for path in [*files, *(Path(__file__).with_name(name) for name in _OF_TRIALS)]:
        digest.update(path.relative_to(_ROOT).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
