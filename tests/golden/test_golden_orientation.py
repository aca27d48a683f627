"""Golden response of the expressive figure and the orientation field to rotations of the stylus.

``python tests/golden/test_golden_orientation.py`` rewrites the file after an intended change.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.curves.trajectory import Trajectory
from controllers.fields.orientation import Orientation
from controllers.haptic_map.composite import Composite
from controllers.state import HandState
from experiments.setups.parts.expression import expressive_figure, lap_turns
from models.humanoid.skeleton import BODIES
from models.mocap.library import embedded
from sim.users.hand.actions import turn_table
from sim.users.hand.fingers import wanted_turn

GOLDEN = Path(__file__).with_name("orientation.csv")
CURVE = Trajectory.circle(0.0477, 4.0)
JOINTS = ("abdomen", "chest", "head")


def _rows():
    """Every 50 ms of three laps: time, quaternions of abdomen, chest and head, moment of the field."""
    clips = [(embedded(name).poses, embedded(name).fps) for name in ("walk", "cheer", "angry")]
    figure = expressive_figure(Composite(*clips, [BODIES.index(joint) for joint in JOINTS], (0.02, 0.07)))
    turns = [turn for lap in range(3) for turn in lap_turns(4.0 * lap, 4.0, lap)]
    table = turn_table([replace(turn, angle=np.copysign(1.2, turn.angle)) for turn in turns])
    field, memory = Orientation(CURVE, 0.2, 3e-3), figure.compiled().memory
    rows, turn, rate = [], np.empty(3), np.empty(3)
    # Not from the seam of the lap, where rounding would decide which lap it is.
    for t in np.arange(0.025, 12.0, 0.05):
        wanted_turn(table, t, turn, rate)
        q = np.roll(Rotation.from_rotvec(turn).as_quat(), 1)
        pose = figure.pose(np.concatenate([CURVE.point(t), q]), memory)
        hand = HandState(t, CURVE.point(t), q, CURVE.velocity(t), rate)
        joints = np.concatenate([pose[3 + 4 * k : 7 + 4 * k] for k in map(BODIES.index, JOINTS)])
        rows.append(np.concatenate([[t], joints, field.wrench(hand).torque]))
    return np.array(rows)


def test_figure_pose_and_field_moment_match_golden_values():
    golden, rows = np.loadtxt(GOLDEN, delimiter=",", skiprows=1), _rows()
    np.testing.assert_allclose(rows, golden, atol=1e-9)
    assert np.ptp(rows[:, 9:13], axis=0).max() > 0.5
    assert np.ptp(rows[:, 13:], axis=0).min() > 0.3


if __name__ == "__main__":
    names = [f"{joint} {number}" for joint in JOINTS for number in "wxyz"] + [f"moment {axis}" for axis in "xyz"]
    np.savetxt(GOLDEN, _rows(), fmt="%.12g", delimiter=",", header=",".join(["t", *names]))
