"""Python code and commands in a separate process, and the names of what that process compiles."""

import subprocess
import sys

LISTENER = """
import sys
from numba.core import event

class Compilations(event.Listener):
    def on_start(self, compilation):
        print("compiles", compilation.data["dispatcher"].py_func.__qualname__, file=sys.stderr)

    def on_end(self, compilation):
        pass

event.register("numba:compile", Compilations())
"""
COMMAND = "from experiments.cli import main; sys.exit(main(sys.argv[1:]))"


def run_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The completed process of Python code with command-line arguments."""
    return subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)


def compiled_names(completed: subprocess.CompletedProcess[str]) -> list[str]:
    """Lines that name the functions compiled by a process whose code begins with `LISTENER`."""
    return [line for line in completed.stderr.splitlines() if line.startswith("compiles")]
