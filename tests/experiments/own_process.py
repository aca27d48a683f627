"""Python code and commands in a separate process, and the names of what that process compiles."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

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


def default_interrupt() -> None:
    """Undo the ignored SIGINT that a child of a background shell inherits."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def stderr_of_interrupted(words: list[str], ready: Callable[[], bool], wait: float) -> str:
    """stderr of a command that gets SIGINT `wait` seconds after it is ready."""
    process = subprocess.Popen(
        [sys.executable, "-m", "experiments.cli", *words], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        start_new_session=True, preexec_fn=default_interrupt,
    )  # fmt: skip
    deadline = time.monotonic() + 120.0
    while not ready() and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(wait)
    os.killpg(process.pid, signal.SIGINT)
    stderr = process.communicate(timeout=60)[1]
    assert process.returncode == 130, stderr
    return stderr
