"""What the step of the physics changes: runs at a step and at an eighth of it, mode by mode.

``python -m experiments.studies.step_accuracy [STEP...]`` prints the table of `docs/validation/physics-step.md`.
"""

import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from rich.console import Console

from experiments.compiling import compile_once
from experiments.config.maps import Led
from experiments.config.modes import Bunny, Follow, Lead, Rivers, Stretch, StretchThenFollow
from experiments.config.run_config import RunConfig, User
from experiments.setups.wiring import wire
from models.humanoid.skeleton import N_POSE
from models.mocap.clip import pose_difference
from sim.loop.loop import Loop, pose_errors, tick_channels
from sim.loop.servo import FrameLog, TickLog

Array = npt.NDArray[np.float64]

SECONDS, FINER = 8.0, 8
MODES = {
    "follow": RunConfig(mode=Follow()),
    "follow, pushed": RunConfig(mode=Follow(), user=User(does="push")),
    "bunny": RunConfig(mode=Bunny()),
    "rivers": RunConfig(mode=Rivers()),
    "stretch": RunConfig(mode=Stretch()),
    "stretch-then-follow": RunConfig(mode=StretchThenFollow()),
    "lead": RunConfig(mode=Lead(), map=Led(), user=User(does="lead")),
}
HEAD = (
    "| mode | step ms | stylus apart µm RMS | force apart % | figures apart ° RMS | figure off its reference ° "
    "| root off at most cm |\n|---|---|---|---|---|---|---|"
)


class Course(NamedTuple):
    """A run as it went.

    Attributes
    ----------
    p, force : Array
        Stylus [m] and commanded force [N], shape (n, 3).
    poses, reference : Array
        Of the figure, shape (m, 75).
    """

    p: Array
    force: Array
    poses: Array
    reference: Array


def course(config: RunConfig, step: float) -> Course:
    """Run a configuration at a step of the physics [s]."""
    config = replace(config, clock=replace(config.clock, physics_step=step))
    session = wire(config, ready=lambda units: compile_once(Console(stderr=True), units))
    every, root = session.servo.figure_ticks, session.world.pose_at
    parts: list[tuple[Array, ...]] = []

    def keep(ticks: TickLog, frames: FrameLog, n: int) -> None:
        m, channels = -(-n // every), tick_channels(ticks, n)
        rows = (channels["p"], channels["force"], frames.qpos[:m, root : root + N_POSE], frames.reference[:m])
        parts.append(tuple(channel.copy() for channel in rows))

    Loop(session.servo, session.world, keep).run(SECONDS)
    return Course(*(np.concatenate(rows) for rows in zip(*parts, strict=True)))


def row(name: str, step: float, coarse: Course, fine: Course) -> str:
    """A line of the table."""
    (joints, root), (finer_joints, finer_root) = (pose_errors(c.poses, c.reference) for c in (coarse, fine))
    turns = pose_difference(coarse.poses, fine.poses)[:, 6:]
    apart, force = 1e6 * _rms(coarse.p - fine.p), 100.0 * _rms(coarse.force - fine.force) / _rms(fine.force)
    figures = np.rad2deg(_rms(turns) / np.sqrt(turns.shape[1] / 3))
    off = [f"{np.rad2deg(_rms(one[:, None])):.2f}" for one in (joints, finer_joints)]
    return (
        f"| {name} | {1e3 * step:g} | {apart:.1f} | {force:.0f} | {figures:.2f} | {off[0]}, {off[1]} | "
        f"{100 * root.max():.0f}, {100 * finer_root.max():.0f} |"
    )


def _rms(rows: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=1))))


def main(steps: list[float]) -> None:
    """Print the table."""
    print(HEAD)
    for name, config in MODES.items():
        for step in steps:
            print(row(name, step, course(config, step), course(config, step / FINER)), flush=True)


if __name__ == "__main__":
    main([float(step) for step in sys.argv[1:]] or [1e-3, 5e-4])
