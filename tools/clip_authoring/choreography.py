"""Key poses and footsteps of the embedded dances and gestures, interpolated by `tools.clip_authoring.key_poses`.

Angles in degrees, lengths in metres, times in seconds; the figure faces +x, its left is +y.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.mocap.motion.clip import Clip
from tools.clip_authoring.balance import balanced_clip
from tools.clip_authoring.key_poses import Arm, Choreography, Key, Lap, Step

FPS = 60.0  # [1/s]


def angry() -> Choreography:
    """One-armed anger: two stabs with a pointing arm, a shaken fist, a stamp of the foot."""
    aimed = Arm(raised=104, plane=10, turn=10, elbow=10, pronation=20)
    drawn = Arm(raised=66, plane=35, turn=10, elbow=100, pronation=20)
    fist = Arm(raised=72, plane=48, turn=-42, elbow=112, pronation=15, wrist=15)
    shaken = replace(fist, raised=80, plane=38, turn=-30, elbow=74)
    lifted = replace(fist, raised=108, plane=60, elbow=84)
    down = Arm(raised=36, plane=48, turn=20, elbow=26, pronation=30)
    tense = Arm(raised=26, plane=100, turn=30, elbow=50, pronation=20, wrist=20)
    falling = Arm(raised=32, plane=50, turn=15, elbow=66)
    bent = replace(tense, raised=36, elbow=72)
    return Choreography(
        "angry",
        3.6,
        [
            Key(0.0, x=-0.05, y=0.0, height=0.885, yaw=-4, lean=2, tilt=0, trunk=(2, 0, -16), head=(4, 0, 8),
                right_arm=replace(drawn, raised=52), left_arm=tense),
            Key(0.36, x=0.03, y=0.03, height=0.86, yaw=10, lean=9, trunk=(18, 2, 18), head=(8, -4, -8),
                right_arm=aimed, left_arm=bent),
            Key(0.68, x=0.0, y=0.02, height=0.87, trunk=(11, 1, 2), right_arm=drawn),
            Key(0.98, x=0.05, y=0.04, height=0.845, yaw=12, lean=11, trunk=(22, 4, 20), head=(12, -8, -8),
                right_arm=aimed, left_arm=tense),
            Key(1.25, x=0.04, y=0.03, trunk=(20, 4, 18), head=(8, 4, -8), right_arm=replace(aimed, elbow=13)),
            Key(1.62, x=-0.01, y=-0.02, height=0.885, yaw=0, lean=4, trunk=(4, -2, -8), head=(0, 6, 6),
                right_arm=fist, left_arm=bent),
            Key(1.79, right_arm=shaken, trunk=(12, -2, 0), head=(8, 6, 0)),
            Key(1.96, right_arm=fist, trunk=(5, -2, -7), head=(0, 4, 6)),
            Key(2.13, right_arm=shaken, trunk=(13, -3, 0), head=(8, 2, 0)),
            Key(2.30, height=0.88, right_arm=fist, trunk=(5, -3, -8), head=(0, -2, 6)),
            Key(2.40, y=-0.05, left_arm=bent),
            Key(2.60, yaw=-4, lean=2, trunk=(0, -4, -12), head=(-4, 4, 8), right_arm=lifted),
            Key(2.94, x=0.02, y=-0.02, height=0.85, yaw=4, lean=10, trunk=(20, 0, 12), head=(10, 0, -4),
                right_arm=down, left_arm=tense),
            Key(3.25, x=0.0, height=0.88, lean=6, trunk=(12, 0, 0), right_arm=falling),
        ],
        [
            Step(0.0, 0.06, 0.13, yaw=12),
            Step(2.42, 0.06, 0.13, yaw=12),
            Step(2.66, 0.08, 0.13, z=0.15, yaw=12, pitch=10, rest=False),
            Step(2.88, 0.06, 0.13, yaw=12),
        ],
        [Step(0.0, -0.10, -0.13, yaw=-20)],
        Lap(),
    )  # fmt: skip


def cheer() -> Choreography:
    """Both arms thrown up and pumped twice, with a bounce in the knees."""
    low = Arm(raised=38, plane=55, turn=10, elbow=85)
    thrown = Arm(raised=152, plane=72, elbow=14, wrist=-10)
    pumped = Arm(raised=112, plane=68, turn=-35, elbow=86)
    spread = replace(thrown, raised=158, plane=80, elbow=8)
    again = replace(thrown, raised=140, elbow=25)
    falling = replace(low, raised=52, elbow=60)
    crouch, bounce, tall = 0.78, 0.845, 0.895
    return Choreography(
        "cheer",
        3.0,
        [
            Key(0.0, x=-0.02, y=0.0, height=crouch, yaw=0, lean=12, tilt=0, trunk=(18, 0, 0), head=(2, 0, 0),
                left_arm=low, right_arm=low),
            Key(0.45, height=tall, lean=-2, trunk=(-9, 0, 0), head=(-18, 0, 0), left_arm=thrown, right_arm=thrown),
            Key(0.80, y=0.03, height=bounce, yaw=4, lean=4, trunk=(0, 4, 4), head=(-6, 4, 10),
                left_arm=pumped, right_arm=pumped),
            Key(1.10, y=0.04, height=tall, trunk=(-8, 7, 6), head=(-16, 4, 12), left_arm=spread, right_arm=spread),
            Key(1.45, y=-0.03, height=bounce, yaw=-4, lean=4, trunk=(0, -4, -4), head=(-6, -4, -10),
                left_arm=pumped, right_arm=pumped),
            Key(1.75, y=-0.04, height=tall, lean=-2, trunk=(-8, -7, -6), head=(-16, -4, -12),
                left_arm=spread, right_arm=spread),
            Key(2.10, y=0.0, height=0.88, yaw=0, trunk=(-2, 0, 0), head=(-8, 0, 0),
                left_arm=again, right_arm=again),
            Key(2.60, height=0.84, lean=8, trunk=(12, 0, 0), head=(0, 0, 0), left_arm=falling, right_arm=falling),
        ],
        [Step(0.0, 0.0, 0.14, yaw=12)],
        [Step(0.0, 0.0, -0.14, yaw=-12)],
        Lap(),
    )  # fmt: skip


def spin() -> Choreography:
    """A dancer's turn to the left in eight quick steps, arms out, the head holding its gaze and then whipping round."""
    lap, steps = 3.6, 8
    beat, turn = lap / steps, 360 / steps
    radius = 0.13

    def track(side: int) -> list[Step]:
        track = []
        for k in range(0 if side > 0 else 1, steps, 2):
            heading = k * turn
            angle = np.deg2rad(heading)
            x, y = -radius * side * np.sin(angle), radius * side * np.cos(angle)
            yaw = heading + side * 10
            track += [Step(k * beat, x, y, yaw=yaw), Step((k + 2) * beat - 0.34, x, y, yaw=yaw)]
        return track

    wide = Arm(raised=84, plane=78, turn=-10, elbow=22, pronation=-5, wrist=-8)
    high = Arm(raised=122, plane=72, turn=-10, elbow=34, wrist=-8)
    low = Arm(raised=62, plane=66, turn=0, elbow=24, wrist=-8)
    return Choreography(
        "spin",
        lap,
        [
            Key(0.0, x=0.0, y=0.0, yaw=0, lean=1, tilt=0, trunk=(-2, -4, 6), head=(0, 4, 4),
                left_arm=high, right_arm=low),
            Key(0.6, head=(0, 3, -50)),
            Key(0.9, trunk=(-3, 0, 10), head=(0, 2, -62), left_arm=wide, right_arm=wide),
            Key(1.8, trunk=(-2, 6, 6), head=(2, -4, 0), left_arm=low, right_arm=high),
            Key(2.7, trunk=(-3, 0, 10), head=(0, -2, 62), left_arm=wide, right_arm=wide),
            Key(3.0, head=(0, 0, 54)),
            *(Key(k * beat / 2, height=0.9 if k % 2 == 0 else 0.88) for k in range(2 * steps)),
        ],
        track(1),
        track(-1),
        Lap(yaw=360),
    )  # fmt: skip


def squat_dance() -> Choreography:
    """The Russian dance: deep in the knees, arms folded, legs kicked forwards in turn."""
    beat = 0.9
    upper = Arm(raised=92, plane=10, turn=62, elbow=92, pronation=10)
    lower = Arm(raised=74, plane=10, turn=64, elbow=90, pronation=10)
    low, high = 0.55, 0.61

    def track(side: int, first: float) -> list[Step]:
        track = []
        for start in (first, first + 2 * beat):
            stand = Step(start - beat, 0.0, side * 0.10, yaw=side * 24, knee=20)
            track += [
                replace(stand, t=start - beat - 0.02),
                # Under full body weight the knee is over the foot, which reduces the moments at knee and hip.
                replace(stand, t=start - beat + 0.16, knee=0, rest=False),
                replace(stand, t=start - beat / 2, knee=-4, rest=False),
                replace(stand, t=start - 0.16, knee=0, rest=False),
                replace(stand, t=start + 0.06),
                Step.in_air(start + 0.45, (0.66, side * 0.12, 0.41), yaw=side * 10, pitch=-35, knee=5),
            ]
        return track

    keys = []
    for k in range(4):
        side = 1 if k % 2 == 0 else -1
        t = k * beat
        trunk, head = (29, -9 * side, 8 * side), (-14, 0, 6 * side)
        keys += [
            Key(t, x=-0.17, y=0.0, height=high, yaw=0, lean=8, tilt=0, trunk=(26, 0, 0), head=(-14, 0, 0),
                left_arm=upper, right_arm=lower),
            Key(t + beat / 2, height=low, yaw=-4 * side, lean=4, trunk=trunk, head=head),
        ]  # fmt: skip
    return Choreography("squat_dance", 4 * beat, keys, track(1, 0.0), track(-1, beat), Lap())  # fmt: skip


def ginga() -> Choreography:
    """Capoeira's ginga: a triangle of steps behind low guarding arms, the second one swinging out into a kick."""
    guard = Arm(raised=62, plane=-8, turn=20, elbow=112, pronation=20)
    open_guard = Arm(raised=50, plane=30, turn=15, elbow=112, pronation=10)
    back = Arm(raised=38, plane=125, turn=10, elbow=40, pronation=10)
    return Choreography(
        "ginga",
        4.0,
        [
            Key(0.0, x=0.0, y=0.05, height=0.74, yaw=0, lean=12, tilt=0, trunk=(16, 0, 0), head=(-8, 0, 0),
                left_arm=open_guard, right_arm=open_guard),
            Key(0.55, x=-0.08, y=0.06, height=0.70, yaw=-10, lean=18, trunk=(18, 9, 8), head=(-12, 0, 12),
                left_arm=back, right_arm=guard),
            Key(1.10, x=0.0, y=-0.02, height=0.75, yaw=0, lean=12, trunk=(16, 0, 0), head=(-8, 0, 0),
                left_arm=open_guard, right_arm=open_guard),
            Key(1.65, x=-0.08, y=-0.08, height=0.70, yaw=10, lean=18, trunk=(18, -9, -8), head=(-12, 0, -12),
                left_arm=guard, right_arm=back),
            Key(2.16, x=0.02, y=-0.2, height=0.80, yaw=4, lean=4, trunk=(8, 0, -4),
                left_arm=open_guard, right_arm=open_guard),
            Key(2.62, x=0.0, y=-0.24, height=0.86, yaw=-6, lean=-14, trunk=(4, 0, 6), head=(6, 0, 6),
                left_arm=back, right_arm=guard),
            Key(3.18, x=0.0, y=-0.16, height=0.80, yaw=0, lean=6, trunk=(12, 0, 0), head=(-4, 0, 0),
                left_arm=open_guard, right_arm=guard),
            Key(3.62, x=0.0, y=0.0, height=0.75, yaw=0, lean=12, trunk=(16, 0, 0), head=(-8, 0, 0),
                left_arm=open_guard, right_arm=open_guard),
        ],
        [
            Step(0.0, 0.0, 0.25, yaw=14, knee=8),
            Step(1.24, 0.0, 0.25, yaw=14, knee=8),
            Step(1.70, -0.46, 0.14, yaw=14, pitch=34, knee=6),
            Step(1.90, -0.46, 0.14, yaw=14, pitch=34, knee=6),
            Step.in_air(2.30, (0.15, 0.12, 0.5), yaw=4, pitch=10),
            Step.in_air(2.62, (0.80, 0.06, 1.02), yaw=0, pitch=-64),
            Step.in_air(2.92, (0.30, 0.18, 0.5), yaw=4, pitch=-5),
            Step(3.32, 0.0, 0.25, yaw=14, knee=8),
        ],
        [
            Step(0.10, 0.0, -0.25, yaw=-14, knee=8),
            Step(0.56, -0.46, -0.14, yaw=-14, pitch=34, knee=6),
            Step(0.70, -0.46, -0.14, yaw=-14, pitch=34, knee=6),
            Step(1.16, 0.0, -0.25, yaw=-14, knee=8),
        ],
        Lap(),
    )  # fmt: skip


def _clip_maker(choreography: Callable[[], Choreography]) -> Callable[[], Clip]:
    return lambda: balanced_clip(choreography(), FPS)


CLIPS: dict[str, Callable[[], Clip]] = {c.__name__: _clip_maker(c) for c in (angry, cheer, spin, squat_dance, ginga)}
