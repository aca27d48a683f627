"""Motions of the small synthetic clips, and their lift."""

import numpy as np

from controllers.haptic_map.lifting.lift import lift
from controllers.haptic_map.lifting.motion_features import Motion
from controllers.haptic_map.lifting.room import Room

WEIGHTS = np.array([0.4, 0.2, 0.15, 0.1])
ROOM = Room()


def motion(poses, name="clip", fps=30.0, closed=True, supports=None):
    return Motion(poses, fps, name, closed, np.ones((len(poses), 2), bool) if supports is None else supports)


def lifted_at(motions, room=ROOM, seed=1):
    return lift(motions, WEIGHTS, room, np.random.default_rng(seed))
