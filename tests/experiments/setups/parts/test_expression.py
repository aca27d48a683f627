"""The figure's gaze and lean: direction, joint ranges, and unmoved feet."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.follow import Follow
from controllers.haptic_map.expressive import express
from experiments.config.modes import OrientationMoment
from experiments.config.options import run_config
from experiments.setups.modes.fixed_curve import with_moment
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.expression import expressive_figure
from experiments.setups.wiring import wire
from models.humanoid.skeleton import BODIES, FOOT_CONTACTS, JOINTS, figure_model, joint_range
from models.mocap.library import embedded, embedded_names

FIGURE = figure_model()


def wxyz(rotation):
    return np.roll(rotation.as_quat(), 1)


def rotations(poses, joint):
    quaternions = poses[:, 3 + 4 * joint : 7 + 4 * joint]
    return Rotation.from_quat(np.roll(quaternions, -1, axis=1))


@pytest.fixture(scope="module")
def figure_map():
    return expressive_figure(wire(run_config(clips=("walk",), seconds=0.1), load_clips(("walk",))[0]).haptic_map)


def placed(pose):
    data = mujoco.MjData(FIGURE)
    data.qpos[:] = pose
    mujoco.mj_forward(FIGURE, data)
    return data


@pytest.mark.parametrize(
    ("turn", "axis", "sign"),
    [((0.0, 0.0, 0.5), 1, 1.0), ((0.0, 0.5, 0.0), 2, -1.0), ((0.0, 0.0, -0.5), 1, -1.0), ((0.0, -0.5, 0.0), 2, 1.0)],
)
def test_head_looks_where_the_stylus_points(figure_map, turn, axis, sign):
    x = np.array([0.05, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    turned = np.concatenate([x[:3], wxyz(Rotation.from_rotvec(turn))])
    before, after = (placed(figure_map.pose(stylus)).body("head").xmat.reshape(3, 3) for stylus in (x, turned))
    looked = Rotation.from_matrix(before).inv().apply(after[:, 0])
    # Left is +y of the head, up is +z: the pen's own direction, half a radian from where it was.
    assert sign * looked[axis] == pytest.approx(np.sin(0.5), abs=0.05)
    assert looked[0] == pytest.approx(np.cos(0.5), abs=0.05)


def test_trunk_leans_with_stylus_roll_and_feet_stay(figure_map):
    x = np.array([0.05, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    rolled = np.concatenate([x[:3], wxyz(Rotation.from_rotvec([0.6, 0.0, 0.0]))])
    before, after = (placed(figure_map.pose(stylus)) for stylus in (x, rolled))
    # About +x the left side goes up: the head moves to the right, −y.
    assert after.body("head").xpos[1] - before.body("head").xpos[1] < -0.05
    for name in (*BODIES[12:], "pelvis"):
        np.testing.assert_array_equal(after.body(name).xpos, before.body(name).xpos)
    for name in FOOT_CONTACTS:
        np.testing.assert_array_equal(after.geom(name).xpos, before.geom(name).xpos)


@pytest.mark.parametrize("name", embedded_names())
def test_joints_stay_in_range_for_any_stylus_orientation(figure_map, name):
    rng = np.random.default_rng(0)
    clip = embedded(name).poses
    poses = clip[rng.integers(len(clip), size=1500)].copy()
    params = figure_map.compiled().params
    for pose, turn in zip(poses, Rotation.random(len(poses), random_state=rng), strict=True):
        express(params, np.concatenate([np.zeros(3), wxyz(turn)]), np.zeros(0), pose, np.empty((0, 6)))
    for joint in ("abdomen", "chest", "head"):
        low, high = joint_range()[JOINTS.index(joint)].T
        vectors = rotations(poses, BODIES.index(joint)).as_rotvec()
        assert (vectors > low).all()
        assert (vectors < high).all()


def test_orientation_moment_is_added_only_on_request():
    curve = Trajectory.circle(0.05, 4.0)
    program = Follow(curve, 300.0, 8.0).program()
    for none in (None, OrientationMoment(), run_config().mode.orientation):
        assert with_moment(program, none, curve, 0.25) is program
    damped = run_config(orientation_damping=1e-3).mode.orientation
    assert len(with_moment(program, damped, curve, 0.25).ops) == len(program.ops) + 2
    belongs = "it belongs to --mode follow, --mode bunny, --mode rivers"
    for options, message in (
        (
            {"mode": "stretch", "orientation_stiffness": 0.1},
            f"--orientation-stiffness has no meaning with --mode stretch; {belongs}",
        ),
        ({"orientation_stiffness": -0.1}, "orientation_stiffness is -0.1; expected 0 N m/rad or more, and finite"),
        ({"orientation_damping": np.nan}, "orientation_damping is nan; expected 0 N m s/rad or more, and finite"),
    ):
        with pytest.raises(ParameterError, match=message):
            run_config(**options)
