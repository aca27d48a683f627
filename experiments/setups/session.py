"""A run that is wired up: its parts, and what of them a recording keeps."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.leading import Leading
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.led import Led
from experiments.config.run_config import MAP_SUFFIX, STRETCHING, RunConfig
from experiments.files.map_files import map_digest
from experiments.setups.lead import lead_static
from experiments.setups.modes import Field
from models.mocap.clip import Clip
from models.phantom.parameters import PREMIUM_1_5
from models.scene import P_WH
from sim.body.figure import Figure
from sim.loop.servo import Servo
from sim.world.world import World

HAND_DOES = {"stretch": "grabs or pushes", "stretch-then-follow": "grabs or pushes", "lead": "leads"}
"""What a hand that exerts a force does, in modes in which it does not just push; in figures."""
DISTANCE_FROM = {"rivers": "its river", "lead": "the figure's path"}
"""What the recorded distance is from, in modes in which that is not the one curve; in figures."""


@dataclass(frozen=True)
class Session:
    """A run that is wired up and has not begun: the servo, and what it was made of.

    The haptic map is that of the clips, or an expressive map about it.
    """

    config: RunConfig
    clips: tuple[Clip, ...]
    remarks: tuple[str, ...]
    curve: Trajectory
    field: Field
    clip_map: ClipMap | Led
    haptic_map: HapticMap
    world: World
    figure: Figure
    servo: Servo

    def static(self) -> dict[str, npt.ArrayLike | str]:
        """What the recording keeps beside the channels."""
        phases = np.linspace(self.curve.start, self.curve.end, 241)
        return {
            "curve": self.curve.point(phases),
            "curve_span": np.array([self.curve.start, self.curve.end]),
            "curve_closed": float(self.curve.periodic),
            **self._tube(),
            "distance_from": DISTANCE_FROM.get(self.config.mode, "the curve"),
            "hand_does": HAND_DOES.get(self.config.mode, "traces" if self.config.user == "trace" else "pushes"),
            "p_WH": P_WH,
            "motor_continuous": np.array(PREMIUM_1_5.continuous_torque),
            "motor_peak": np.array(PREMIUM_1_5.peak_torque),
            "body_weight": self.figure.state.weight,
            "clip_names": "\n".join(clip.name for clip in self.clips),
            **{f"clip_{i}": clip.poses for i, clip in enumerate(self.clips)},
            "clip_fps": np.array([clip.fps for clip in self.clips]),
            **({"map_sha256": map_digest(Path(self.config.map))} if self.config.map.endswith(MAP_SUFFIX) else {}),
            **(lead_static(self.field) if isinstance(self.field, Leading) else {}),
            **self._rivers(),
        }

    def _tube(self) -> dict[str, npt.ArrayLike | str]:
        """Radius of what is drawn about the curve [m], and what that is; 0 where there is nothing about it."""
        tubes = {"rivers": self.config.river_tube} | dict.fromkeys(STRETCHING, self.config.rubber_tube)
        if self.config.mode in tubes:
            return {"tube_radius": tubes[self.config.mode], "tube_name": "tube"}
        if self.config.mode == "lead":
            return {"tube_radius": 0.0}
        return {"tube_radius": self.config.reach, "tube_name": "map's domain"}

    def _rivers(self) -> dict[str, npt.ArrayLike | str]:
        """Names and curves of a field's rivers."""
        if not isinstance(self.field, HigherOrder | RiverBundle):
            return {}
        bundle = self.field.bundle if isinstance(self.field, HigherOrder) else self.field
        share = np.linspace(0.0, 1.0, 241)
        curves = [r.curve.point(r.curve.start + share * r.curve.duration) for r in bundle.rivers]
        return {"river_names": "\n".join(bundle.names), "river_curves": np.array(curves)}
