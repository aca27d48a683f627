"""The channels of a trial that are kept in memory until the trial is measured."""

import numpy as np

from geometry.arrays import Array
from sim.body.figure_state import FigureState
from sim.loop.channels import frame_channels, tick_channels
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.world.world import World

_TICK_CHANNELS = ("t", "p", "v", "user", "force", "phase", "nearest", "distance", "river", "fault")


class TrialLog:
    """An observer of a `Loop` that keeps the channels that measures need.

    Attributes
    ----------
    ticks, frames : dict of str to Array
        Data by channel, with the names of `sim.loop.channels.groups`; `frames` is empty without a figure, and has no
        errors and forces for a kinematic figure.
    """

    def __init__(self, servo: Servo, world: World):
        self._ticks_per_frame, self._pose_at = servo.figure_ticks, world.pose_at
        self._is_physical, self._has_figure = isinstance(servo.figure, FigureState), world.has_figure
        self._tick_blocks: dict[str, list[Array]] = {name: [] for name in _TICK_CHANNELS}
        self._frame_blocks: dict[str, list[Array]] = {}

    def __call__(self, ticks: TickLog, frames: FrameLog, n: int) -> None:
        """Add a block."""
        channels = tick_channels(ticks, n)
        for name, blocks in self._tick_blocks.items():
            blocks.append(channels[name].copy())
        if not self._has_figure:
            return
        n_frames = -(-n // self._ticks_per_frame)
        figure_channels = {"t": frames.t[:n_frames], "reference": frames.reference[:n_frames]}
        if self._is_physical:
            figure_channels = frame_channels(frames, n_frames, self._pose_at)
            del figure_channels["qpos"]
        for name, block in figure_channels.items():
            self._frame_blocks.setdefault(name, []).append(block.copy())

    @property
    def ticks(self) -> dict[str, Array]:
        """Channels at the rate of the servo."""
        return {name: np.concatenate(blocks) for name, blocks in self._tick_blocks.items()}

    @property
    def frames(self) -> dict[str, Array]:
        """Channels at the rate of the figure's control; none without a figure."""
        return {name: np.concatenate(blocks) for name, blocks in self._frame_blocks.items()}
