"""The default animation: that of the unedited curve, with which the edited one is compared."""

from collections.abc import Callable

import numpy as np

from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.state import stylus_path
from controllers.walking.walker import walker_at
from experiments.fitting.figure_legs import packed_legs
from experiments.setups.session import Session
from geometry.arrays import Array
from sim.reference.reference import make_reference, map_poses, reference_along


def default_poses(session: Session, stride: int = 1) -> Callable[[Array, Array, Array], Array]:
    """A function from nearest points (k, 3), phases (k,) and rivers (k,) to poses (k, 75) of the default animation.

    It is called with rows in the order of time, `stride` figure updates apart.
    """
    if session.parts.maps.plays_rivers:
        return _river_animation(session, stride)
    haptic_map = session.haptic_map
    memory = haptic_map.compiled().memory
    if session.parts.walking is not None:
        memory = walker_at.py_func(session.servo.field.walkers.state, 0).path.copy()

    def poses_at(nearest: Array, phases: Array, rivers: Array) -> Array:
        return map_poses(haptic_map, session.parts.argument_at(nearest, phases), memory)

    return poses_at


def _river_animation(session: Session, stride: int) -> Callable[[Array, Array, Array], Array]:
    """The same where each river plays its own clip, with the transitions between clips that the figure made."""
    period = stride * session.servo.figure_ticks * session.servo.plant.period
    compiled, part, figure = session.haptic_map.compiled(), session.config.figure, session.world.body
    reference = make_reference(figure, compiled, period, part.smoothing, part.blend, packed_legs(figure))

    def poses_at(nearest: Array, phases: Array, rivers: Array) -> Array:
        traces = np.zeros((len(nearest), TRACE_SIZE))
        traces[:, TRACE_PHASE], traces[:, TRACE_RIVER] = phases, rivers
        poses = np.empty((len(nearest), session.haptic_map.nq))
        reference_along(reference, stylus_path(nearest), traces, poses)
        return poses

    return poses_at
