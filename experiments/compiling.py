"""What a run needs compiled, made in a process of its own, which gives back the memory that a compiler takes."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
from rich.console import Console

from controllers.fields.law import Program
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.evaluate import kinds_of
from experiments.config.run_config import ArmConfig, RunConfig
from sim.compilation.compiled import CACHE_FOLDER
from sim.compilation.kernel_units import is_kept

Config = RunConfig | ArmConfig


def compiled_parts(body: str, haptic_map: CompiledMap, program: Program | None = None) -> tuple[str, ...]:
    """Names of what is compiled by itself for a run: the loop for a body, kernels of the map and of the field's laws.

    Parameters
    ----------
    body : str
        ``figure`` or ``arm``.
    haptic_map : CompiledMap
        Whose poses the body follows, and whose walls the field may have.
    program : Program, optional
        The field, if it is known.
    """
    kinds = kinds_of(haptic_map.kind, haptic_map.params)
    kernels = () if program is None else program.kernels
    laws = {getattr(kernel, "__name__") for kernel in kernels if is_kept(kernel)}  # noqa: B009 - a dispatcher
    return (body, *(f"map-{kind}" for kind in kinds), *(f"law-{name}" for name in sorted(laws)))


def compile_once(console: Console, config: Config, parts: tuple[str, ...]) -> None:
    """Compile all that a run needs, if any of these parts has not been compiled by this version of the code.

    It says so first. A compilation that fails leaves it to the run itself, which then says what is wrong.
    """
    if all(_mark(part).exists() for part in parts):
        return
    console.print("Compiling what this run needs; this happens once for each version of the code.")
    subprocess.run(
        [sys.executable, "-m", "experiments.compiling"], input=pickle.dumps(config), check=False, capture_output=True
    )


def _mark(part: str) -> Path:
    return CACHE_FOLDER / f"{part}.compiled"


def _compile(config: Config) -> None:
    from sim.loop.loop import Loop

    parts: set[str] = set()
    if isinstance(config, ArmConfig):
        from experiments.setups.robot_arm import wire_arm

        servo, world, _ = wire_arm(config, parts.update)
    else:
        from experiments.run import default_poses
        from experiments.setups.clips import load_clips
        from experiments.setups.wiring import wire

        session = wire(config, load_clips(config.clips)[0], ready=parts.update)
        servo, world = session.servo, session.world
        default_poses(session)(np.empty((0, 3)), np.empty(0), np.empty(0))
    Loop(servo, world).run(servo.plant.period * servo.figure_ticks)
    for part in parts:
        _mark(part).touch()


if __name__ == "__main__":
    _compile(pickle.load(sys.stdin.buffer))
