"""The channels of a trial that are kept in memory until the trial is measured."""

import numpy as np

from controllers.state import Array
from sim.body.figure_state import FigureState
from sim.loop.channels import frame_channels, tick_channels
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.world.world import World

_TICKS = ("t", "p", "v", "user", "force", "phase", "nearest", "distance", "river", "fault")


class TrialLog:
    """An observer of a `Loop` that keeps the channels that measures need.

    Attributes
    ----------
    ticks, frames : dict of str to Array
        Data by channel, with the names of `sim.loop.channels.groups`; without a figure `frames` is empty, and for a
        kinematic figure it has no errors and forces.
    """

    def __init__(self, servo: Servo, world: World):
        self._every, self._pose_at = servo.figure_ticks, world.pose_at
        self._physical, self._shown = isinstance(servo.figure, FigureState), world.has_figure
        self._ticks: dict[str, list[Array]] = {name: [] for name in _TICKS}
        self._frames: dict[str, list[Array]] = {}

    def __call__(self, ticks: TickLog, frames: FrameLog, n: int) -> None:
        """Add a block."""
        channels = tick_channels(ticks, n)
        for name, blocks in self._ticks.items():
            blocks.append(channels[name].copy())
        if not self._shown:
            return
        m = -(-n // self._every)
        of_figure = {"t": frames.t[:m], "reference": frames.reference[:m]}
        if self._physical:
            of_figure = frame_channels(frames, m, self._pose_at)
            del of_figure["qpos"]
        for name, block in of_figure.items():
            self._frames.setdefault(name, []).append(block.copy())

    @property
    def ticks(self) -> dict[str, Array]:
        """Channels at the rate of the servo."""
        return {name: np.concatenate(blocks) for name, blocks in self._ticks.items()}

    @property
    def frames(self) -> dict[str, Array]:
        """Channels at the rate of the figure's control; none without a figure."""
        return {name: np.concatenate(blocks) for name, blocks in self._frames.items()}
