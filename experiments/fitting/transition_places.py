"""Places over the floor of two motions at a transition of a lifted map: how far a change between them moves a figure.

Transitions are found where poses, velocities and standing feet agree, regardless of the place over the floor. Motions
that travel there and back within a lap, such as a run from one end of a room to the other, may be far apart then.
"""

import numpy as np

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.transitions import MapTransition
from controllers.state import stylus_path
from sim.reference.reference import map_poses

# [m]; a hand changes over within about 0.25 s, so this distance moves the figure at 1 m/s. Embedded clips are 3 mm
# apart at their transitions; captures are 1.6 m apart at one, where the figure falls.
_MAX_DISTANCE = 0.25


def places_apart(made: Lifted, transition: MapTransition) -> float:
    """Distance over the floor between the places of two motions at their transition [m]; needs compiled code.

    With q_i the point of curve i at the transition's θ, it is that of the roots of h(q_first) and h(q_second) in one
    frame of the lap.
    """
    points = np.array([made.curve_point(i, transition.angle) for i in (transition.first, transition.second)])
    first, second = map_poses(made, stylus_path(points), made.compiled().memory)[:, :2]
    return float(np.linalg.norm(second - first))


def carried_over(made: Lifted, transition: MapTransition) -> tuple[Lifted, tuple[str, ...]]:
    """The map, and a remark if a change at a transition moves the figure too far to be followed."""
    apart = places_apart(made, transition)
    if apart < _MAX_DISTANCE:
        return made, ()
    names = f"{made.names[transition.first]} and {made.names[transition.second]}"
    return made, (
        f"where {names} agree, their positions on the floor are {apart:.1f} m apart: a push over carries the figure "
        "there within a quarter of a second, and it may fall; clips that stay in place, or keep going, suit better",
    )
