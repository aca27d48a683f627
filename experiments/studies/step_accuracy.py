"""Effect of the physics step: runs at a step compared with runs at an eighth of it, mode by mode.

``python -m experiments.studies.step_accuracy [--modes NAME,...] [STEP...]`` prints the table of
`docs/validation/physics-step.md`.

The force of a tick depends on the tick in which an encoder count arrives, and any change of step shifts that by a tick.
So forces are compared not only tick by tick but also below `BANDWIDTH`, that of a hand's own motion. Shifted counts
also move a hand along its curve a little sooner or later, so its path is compared as well as its position at each
instant.
"""

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from rich.console import Console
from scipy.signal import butter, sosfiltfilt

from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.console.compiling import compiler
from experiments.setups.wiring import wire
from geometry.arrays import Array, rms
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import pose_errors
from models.phantom.parameters import PREMIUM_1_5
from models.world.scene import PHANTOM
from sim.body.figure_state import REPORT_DOWN
from sim.loop.channels import tick_channels
from sim.loop.loop import Loop
from sim.loop.servo import FrameLog, TickLog

RUN_SECONDS, STEP_RATIO = 8.0, 8
BANDWIDTH = 8.0  # [Hz]; for a hand at 8 cm/s this is a wavelength of a centimetre
MODES: Mapping[str, RunConfig] = {
    "follow": run_config(),
    "follow pushed": run_config(user="push"),
    "bunny": run_config(mode="bunny"),
    "rivers": run_config(mode="rivers"),
    "rivers with clips": run_config(mode="rivers", map="rivers"),
    "stretch": run_config(mode="stretch"),
    "stretch-then-follow": run_config(mode="stretch-then-follow"),
    "lead": run_config(mode="lead"),
    "arm": run_config(map="robot-arm", user="push"),
}
TABLE_HEADER = (
    "| mode | step ms | stylus from the path, and at the same instant µm RMS "
    "| difference of force below 8 Hz, and tick by tick % | closure µm | difference of joints ° RMS "
    "| figure from its reference ° | falls |\n|---|---|---|---|---|---|---|---|"
)


class Course(NamedTuple):
    """Course of a run.

    Attributes
    ----------
    period : float
        Period of the servo [s].
    p, force : Array
        Stylus [m] and commanded force [N], shape (n, 3).
    poses, reference : Array
        Simulated and desired poses of the figure, shape (m, 75), or of the arm, (m, 7).
    gap : float
        Largest error of the linkage's loop closure [m].
    falls : int
        Number of falls of the figure.
    """

    period: float
    p: Array
    force: Array
    poses: Array
    reference: Array
    gap: float
    falls: int


def course(config: RunConfig, step: float) -> Course:
    """Run a configuration at a step of the physics [s]."""
    clock = replace(config.clock, physics_step=step)
    session = wire(replace(config, clock=clock), ready=compiler(Console(stderr=True)))
    servo, world = session.servo, session.world
    own = slice(world.pose_at, world.pose_at + world.body.nq)
    elbow, two, three = (int(world.model.joint(PHANTOM + n).qposadr[0]) for n in ("elbow", "theta2", "theta3"))
    every, parts = servo.figure_ticks, list[tuple[Array, ...]]()

    def keep(ticks: TickLog, frames: FrameLog, n: int) -> None:
        m, channels = -(-n // every), tick_channels(ticks, n)
        q = frames.qpos[:m]
        gap = q[:, elbow] + q[:, two] - q[:, three]
        rows = (channels["p"], channels["force"], q[:, own], frames.reference[:m], gap, frames.report[:m, REPORT_DOWN:])
        parts.append(tuple(channel.copy() for channel in rows))

    Loop(servo, world, keep).run(RUN_SECONDS)
    p, force, poses, reference, gap, down = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    falls = int(np.sum(np.diff((down > 0.0).ravel().astype(int)) > 0)) if poses.shape[1] == N_POSE else 0
    closure = PREMIUM_1_5.l1 * float(np.abs(gap).max())
    return Course(clock.servo_period, p, force, poses, reference, closure, falls)


def row(name: str, step: float, coarse: Course, fine: Course) -> str:
    """A line of the table."""
    apart, path = (1e6 * _rms_norm(difference) for difference in (coarse.p - fine.p, off_path(coarse.p, fine.p)))
    force = 100.0 * _rms_norm(coarse.force - fine.force) / _rms_norm(fine.force)
    band = butter(2, BANDWIDTH, fs=1.0 / coarse.period, output="sos")
    slow, finer = (np.asarray(sosfiltfilt(band, c.force, axis=0)) for c in (coarse, fine))
    off = ", ".join(f"{np.rad2deg(_pose_error(c.poses, c.reference)):.2f}" for c in (coarse, fine))
    return (
        f"| {name} | {1e3 * step:g} | {path:.1f}, {apart:.1f} | "
        f"{100.0 * _rms_norm(slow - finer) / _rms_norm(finer):.2g}, {force:.0f} | {1e6 * coarse.gap:.2g} | "
        f"{np.rad2deg(_pose_error(coarse.poses, fine.poses)):.2f} | {off} | "
        f"{coarse.falls}, {fine.falls} |"
    )


def off_path(p: Array, other: Array) -> Array:
    r"""Difference of two paths at the same instants, perpendicular to the other one: :math:`(1 - t t^T)(p - p')`.

    Parameters
    ----------
    p, other : Array
        Positions [m], shape (n, 3), so near each other that the path between them is straight.

    Returns
    -------
    Array
        Shape (n, 3) [m]; the whole difference where the other path stands still.
    """
    tangent, apart = np.gradient(other, axis=0), p - other
    speed = np.linalg.norm(tangent, axis=1, keepdims=True)
    along = np.divide(tangent, speed, out=np.zeros_like(tangent), where=speed > 0.0)
    return apart - np.sum(apart * along, axis=1, keepdims=True) * along


def _pose_error(poses: Array, others: Array) -> float:
    """RMS over joints and time of the angle between poses of a figure, or between an arm's angles [rad]."""
    if poses.shape[1] != N_POSE:
        return rms(poses - others)
    return rms(pose_errors(poses, others)[0])


def _rms_norm(rows: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=1))))


def main(words: list[str]) -> None:
    """Print the table."""
    names = list(MODES)
    if words[:1] == ["--modes"]:
        names, words = words[1].split(","), words[2:]
    steps = [float(word) for word in words] or [1e-3, 5e-4]
    print(TABLE_HEADER)
    for name in names:
        for step in steps:
            print(row(name, step, course(MODES[name], step), course(MODES[name], step / STEP_RATIO)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
