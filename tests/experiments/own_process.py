"""A command in a process of its own, and what that process compiles."""

import subprocess
import sys

TELLS = """
import sys
from numba.core import event

class Compilations(event.Listener):
    def on_start(self, compilation):
        print("compiles", compilation.data["dispatcher"].py_func.__qualname__, file=sys.stderr)

    def on_end(self, compilation):
        pass

event.register("numba:compile", Compilations())
"""
RUNS = "from experiments.cli import main; sys.exit(main(sys.argv[1:]))"


def process(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """What Python says to code of this module or one's own."""
    return subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)


def compiled(ran: subprocess.CompletedProcess[str]) -> list[str]:
    """Names of what it compiled, if `TELLS` came first."""
    return [line for line in ran.stderr.splitlines() if line.startswith("compiles")]
