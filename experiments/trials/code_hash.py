"""Hash of the code that a trial's numbers depend on, so that a row says what it was made with."""

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
    """Hash of the sources that a run and its measures are made of, and of the libraries' versions, 16 hex digits.

    What draws and tells of results is no part of it; nor is the processor, which a row names besides.
    """
    digest = hashlib.sha256(f"{sys.version_info[:2]} {[version(name) for name in _LIBRARIES]}".encode())
    files = [path for folder in _SOURCES for path in sorted((_ROOT / folder).rglob("*.py"))]
    for path in [*files, *(Path(__file__).with_name(name) for name in _OF_TRIALS)]:
        digest.update(path.relative_to(_ROOT).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
