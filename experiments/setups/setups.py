"""Registry of set-ups: the functions that make the parts of a run, by kind of mode and kind of map."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from mujoco import MjModel

from experiments.config.maps import Composite, Cylindrical, Led, Map, RobotArm
from experiments.config.run_config import RunConfig
from experiments.fitting.blendable import longest_flight
from experiments.setups.maps.about_circle import place_of
from experiments.setups.maps.composite import composite_parts
from experiments.setups.maps.cylindrical import cylindrical_parts
from experiments.setups.maps.map_file import map_file_setup
from experiments.setups.maps.river_clips import river_clips_setup
from experiments.setups.maps.robot_arm import arm_parts, tilted
from experiments.setups.modes.bunny import bunny_parts
from experiments.setups.modes.follow import flows_parallel, follow_parts
from experiments.setups.modes.lead import lead_parts
from experiments.setups.modes.rivers import rivers_parts
from experiments.setups.modes.stretch import stretch_parts, stretch_then_follow_parts
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.lap import circle_of
from experiments.setups.parts.led_figure import led_clips, led_parts
from experiments.setups.parts.part_types import ClipMapParts, MapParts, Parts
from models.humanoid.skeleton import DEFAULT_STATURE, figure_model, proportion
from models.mocap.motion.clip import Clip

MODE_SETUPS: dict[str, Callable[..., Parts]] = {
    "follow": follow_parts,
    "bunny": bunny_parts,
    "rivers": rivers_parts,
    "stretch": stretch_parts,
    "stretch-then-follow": stretch_then_follow_parts,
    "lead": lead_parts,
}
"""By kind of mode: the function that makes the parts of a run from configuration, mode and map."""


def _about_circle(make_parts: Callable[..., ClipMapParts]) -> Callable[..., ClipMapParts]:
    def setup(
        config: RunConfig, part: Cylindrical | Composite, clips: tuple[Clip, ...], figure: MjModel
    ) -> ClipMapParts:
        return make_parts(clips, figure, place_of(part), flows_parallel(config))

    return setup


MAP_SETUPS: dict[str, Callable[..., ClipMapParts]] = {
    "cylindrical": _about_circle(cylindrical_parts),
    "composite": _about_circle(composite_parts),
    "rivers": river_clips_setup,
    "file": map_file_setup,
}
"""By kind of map of the figure: the function that makes the map's parts from configuration, map, clips and figure."""


def clips_for(part: Map) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """Clips that a map names, and remarks about them.

    Raises
    ------
    ModelError
        If there is no such clip, or a file cannot be read.
    """
    return led_clips(part) if isinstance(part, Led) else load_clips(part.clips, part.raw)


def map_parts(config: RunConfig, body: MjModel, clips: tuple[Clip, ...] | None = None) -> MapParts[Any]:
    """Map parts of a configuration for a figure or a robot arm, with the given clips or else those that its map names.

    Raises
    ------
    HvfError
        If there is no such clip, file or curve, or the Phantom does not reach the curve.
    """
    played, remarks = clips_for(config.map) if clips is None else (clips, ())
    if isinstance(config.map, RobotArm):
        return arm_parts(body, tilted(circle_of(config.map)), config.map.reach, config.map.scale)
    if isinstance(config.map, Led):
        return led_parts(config, played, body).with_remarks(remarks)
    setup = MAP_SETUPS[config.map.kind]
    return for_size_of(body, lambda model: setup(config, config.map, played, model)).with_remarks(remarks)


def parts_of(config: RunConfig, maps: MapParts[Any]) -> Parts:
    """Parts of a run: its mode's set-up applied to the map's parts."""
    return MODE_SETUPS[config.mode.kind](config, config.mode, maps)


def for_size_of(figure: MjModel, make_parts: Callable[[MjModel], ClipMapParts]) -> ClipMapParts:
    """Map parts of a figure of any stature: made for the default stature, which is that of the clips, and scaled.

    Lengths scaled by s at the same times scale accelerations by s, while gravity stays: a flight of the scaled motion
    is ballistic at 1/√s of its own pace (equal Froude number, Alexander 1989, *Optimization and gaits in the locomotion
    of vertebrates*, Physiol. Rev. 69, 1199-1227).
    """
    size = proportion(figure)
    if size == 1.0:
        return make_parts(figure)
    parts = make_parts(figure_model())
    flying = [clip.name for clip in parts.clips if longest_flight(clip) > 0.0]
    remark = (
        f"the flights of {', '.join(dict.fromkeys(flying))} last as they do at {DEFAULT_STATURE:g} m of stature; "
        f"a figure of {DEFAULT_STATURE * size:.2f} m falls so at {size**-0.5:.2f} of the clips' recorded speed"
    )
    return replace(parts, size=size, remarks=parts.remarks + ((remark,) if flying else ()))
