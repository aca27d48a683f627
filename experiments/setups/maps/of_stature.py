"""Maps for a figure of any stature: made for the default stature, and scaled."""

from collections.abc import Callable
from dataclasses import replace

import mujoco

from experiments.fitting.blendable import longest_flight
from experiments.setups.parts.part_types import ClipMapParts
from models.humanoid.skeleton import DEFAULT_STATURE, figure_model, proportion


def for_size_of(figure: mujoco.MjModel, made: Callable[[mujoco.MjModel], ClipMapParts]) -> ClipMapParts:
    """Map parts of a figure of any stature: made for the default stature, which is that of the clips, and scaled.

    Lengths scaled by s at the same times scale accelerations by s, while gravity stays: a flight of the scaled motion
    is ballistic at 1/√s of its own pace (equal Froude number, Alexander 1989, *Optimization and gaits in the locomotion
    of vertebrates*, Physiol. Rev. 69, 1199-1227).
    """
    size = proportion(figure)
    if size == 1.0:
        return made(figure)
    parts = made(figure_model())
    flying = [clip.name for clip in parts.clips if longest_flight(clip) > 0.0]
    remark = (
        f"the flights of {', '.join(dict.fromkeys(flying))} last as they do at {DEFAULT_STATURE:g} m of stature; "
        f"a figure of {DEFAULT_STATURE * size:.2f} m falls so at {size**-0.5:.2f} of the clips' recorded speed"
    )
    return replace(parts, size=size, remarks=parts.remarks + ((remark,) if flying else ()))
