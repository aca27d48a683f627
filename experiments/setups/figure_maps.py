"""Haptic maps of the figure that a run makes from its clips, by name."""

import mujoco
import numpy as np
import numpy.typing as npt

from controllers.blending.clip_arrays import clip_arrays
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical, correction_shape
from controllers.haptic_map.river_clips import RiverClips
from controllers.legs.footsteps import packed_steppers
from controllers.legs.joint_limits import MARGIN
from controllers.legs.limbs import Limb
from experiments.config.run_config import RunConfig
from experiments.files.kept import kept_array
from experiments.setups.modes import default_rivers
from models.humanoid.skeleton import BODIES, FOOT_CONTACTS, joint_range
from models.mocap.clip import Clip
from sim.compilation.compiled import CACHE_FOLDER

Array = npt.NDArray[np.float64]

_MOST_CLIPS = {"cylindrical": 4, "composite": 3, "rivers": 3}


def clip_map(
    config: RunConfig,
    clips: tuple[Clip, ...],
    curve: Trajectory,
    figure: mujoco.MjModel,
) -> ClipMap:
    """Haptic map that a configuration names, of these clips about a curve.

    Raises
    ------
    ParameterError
        If there is no such map, it takes another number of clips, or does not fit the mode.
    """
    if config.map not in _MOST_CLIPS:
        raise ParameterError(f"no map {config.map!r}; there are {', '.join(_MOST_CLIPS)}, or give a file (.npz)")
    most = _MOST_CLIPS[config.map]
    if not 1 <= len(clips) <= most:
        raise ParameterError(f"the {config.map} map takes 1 to {most} clips, got {len(clips)}; name them with --clips")
    motions = [(clip.poses, clip.fps) for clip in clips]
    radii = (config.radius - config.reach, config.radius + config.reach)
    legs = figure_legs(figure)
    if config.map == "cylindrical":
        corners = [motions[i % len(motions)] for i in range(4)]
        return _cylindrical(corners, radii, (-config.reach, config.reach), legs)
    if config.map == "rivers":
        if config.mode != "rivers" or config.crossing == "sum":
            raise ParameterError(
                "the rivers' map needs --mode rivers, and a --crossing that gives the hand to one river"
            )
        curves = [river.curve for river in default_rivers(config, curve).rivers]
        motions = [motions[i % len(motions)] for i in range(len(curves))]
        return RiverClips(curves, motions, config.river_tube, legs)
    lower, red, blue = (motions[i % len(motions)] for i in range(3))
    upper = set(range(1, len(BODIES))).difference(*(leg.joints for leg in legs))
    return Composite(lower, red, blue, sorted(upper), radii, legs)


def _cylindrical(
    clips: list[tuple[Array, float]], radii: tuple[float, float], heights: tuple[float, float], legs: tuple[Limb, ...]
) -> Cylindrical:
    """The map of four clips; its corrections, once found, are kept beside the compiled code."""

    def find() -> Array:
        return Cylindrical(clips, radii, heights, legs).corrections

    # Where the clips blend is not among what they depend on.
    made_of = clip_arrays(clips, [str(i) for i in range(len(clips))], legs).values()
    corrections = kept_array(CACHE_FOLDER, "corrections", made_of, (-1, *correction_shape(len(legs))), find)
    return Cylindrical(clips, radii, heights, legs, corrections)


def figure_legs(figure: mujoco.MjModel) -> tuple[Limb, ...]:
    """The figure's legs as limbs of a blend: soles are placed where they are in the clips on average."""
    legs: list[Limb] = []
    for side in ("left", "right"):
        bodies = [f"{side}_{part}" for part in ("thigh", "shank", "foot")]
        first, second, third = (BODIES.index(body) for body in bodies)
        offsets = np.array([figure.body(body).pos for body in bodies])
        sole = np.array([figure.geom(name).pos for name in FOOT_CONTACTS if name.startswith(side)])
        # Where a joint that is held comes to rest is its limit.
        limits = joint_range()[[first - 1, second - 1, third - 1]] + 0.5 * MARGIN * np.array([1.0, -1.0])
        legs.append(Limb((first, second, third), offsets, np.array([0.0, 1.0, 0.0]), sole, limits))
    return tuple(legs)


def packed_legs(figure: mujoco.MjModel) -> Array:
    """`figure_legs` as those that step (`packed_steppers`), shape (2, 48)."""
    return packed_steppers(figure_legs(figure))
