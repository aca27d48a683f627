"""Trial before a run: whether the physical figure follows a hand pushed off its curve on a lifted map."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.lifted import Lifted
from experiments.setups.carried import push_profile
from experiments.setups.stylus import stylus_path
from experiments.setups.verdict import tried
from models.mocap.clip import Clip
from sim.reference.reference import poses_along

_SECONDS, _FPS = 20.0, 120.0
_PUSHED = 8e-3  # [m] offset by a push: 2.5 N against 300 N/m
_FIRST = 1.7  # [s] start of the first push


def toured(made: Lifted, curve: Trajectory) -> Clip:
    """The animation of a hand that moves along a curve of a map at its pace and is pushed outwards and inwards.

    A push leaves the hand's speed as it is, as in FOLLOW, so its angular speed is lower the further out it is.
    """
    times = np.arange(round((_SECONDS + 1.0) * _FPS)) / _FPS
    pushed, phase = _PUSHED * push_profile(np.maximum(times - _FIRST, 0.0)), curve.start
    points, poses = np.empty((len(times), 3)), np.empty((len(times), made.nq))
    for point, off in zip(points, pushed, strict=True):
        point[:] = curve.point(phase)
        radius = float(np.hypot(point[0], point[1]))
        point[:2] *= (radius + off) / radius
        phase += radius / (radius + off) / _FPS
        phase = curve.start + (phase - curve.start) % curve.duration if curve.periodic else min(phase, curve.end)
    kind, params, memory = made.compiled()
    poses_along(kind, params, memory.copy(), stylus_path(points), poses)
    return Clip(poses, _FPS, "pushed")


def not_followed(made: Lifted, curve: Trajectory) -> tuple[str, ...]:
    """Remark, if the physical figure does not follow pushes off this curve of the map; needs compiled code."""
    made_of = (made.compiled().params, np.asarray(curve.times), np.asarray(curve.positions))
    verdict = tried(__name__, lambda: toured(made, curve), _SECONDS, made_of)
    return () if verdict.bearable else (f"pushed off its curve to those beside it, the physical figure {verdict}",)
