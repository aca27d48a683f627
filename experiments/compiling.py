"""The servo loop compiled in a process of its own, which gives back the memory that a compiler takes."""

import subprocess
import sys
from pathlib import Path

from rich.console import Console

from experiments.config import ArmConfig, RunConfig
from sim.compiled import CACHE_FOLDER


def compile_once(console: Console, body: str = "figure") -> None:
    """Compile the servo loop for a body, ``figure`` or ``arm``, if this version of the code has not been compiled yet.

    It says so first. A compilation that fails leaves it to the run itself, which then says what is wrong.
    """
    if _mark(body).exists():
        return
    console.print("Compiling the servo loop; this happens once for each version of the code.")
    subprocess.run([sys.executable, "-m", "experiments.compiling", body], check=False, capture_output=True)


def _mark(body: str) -> Path:
    return CACHE_FOLDER / f"{body}.compiled"


def _compile(body: str) -> None:
    from sim.loop import Loop

    if body == "arm":
        from experiments.robot_arm import wire_arm

        servo, world, _ = wire_arm(ArmConfig())
        Loop(servo, world).run(servo.plant.period * servo.figure_ticks)
    else:
        from experiments.clips import load_clips
        from experiments.wiring import wire

        config = RunConfig()
        session = wire(config, load_clips(config.clips)[0])
        Loop(session.servo, session.world).run(session.servo.plant.period * config.figure_ticks)
    _mark(body).touch()


if __name__ == "__main__":
    _compile(sys.argv[1])
