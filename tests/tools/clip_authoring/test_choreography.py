"""The embedded dances and gestures as committed: within human limits, balanced, smooth, and true to their names."""

import mujoco
import numpy as np
import pytest
from scipy.signal import argrelmax
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS, figure_model, joint_range
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import pose_difference
from tests.tools.clip_authoring.support import distance_outside_support
from tools.clip_authoring import __main__ as clip_generator
from tools.clip_authoring.balance import dynamics
from tools.clip_authoring.choreography import CLIPS

MODEL = figure_model()
IN_PLACE = ("angry", "cheer", "spin", "squat_dance")
TRUNK = ("pelvis", "abdomen", "chest", "head")

each_clip = pytest.mark.parametrize("name", CLIPS)


@pytest.fixture(scope="module")
def clips():
    return {name: embedded(name) for name in CLIPS}


@pytest.fixture(scope="module")
def motions(clips):
    return {name: dynamics(clip) for name, clip in clips.items()}


def rotation_vectors(clip):
    """Rotation vectors of the 17 joints, shape (n, 17, 3)."""
    quaternions = clip.poses[:, 7:].reshape(-1, 4)
    return Rotation.from_quat(quaternions, scalar_first=True).as_rotvec().reshape(-1, len(JOINTS), 3)


def positions(clip, *bodies):
    """Origins of bodies frame by frame, shape (n, bodies, 3)."""
    data, ids = mujoco.MjData(MODEL), [MODEL.body(body).id for body in bodies]
    origins = np.empty((len(clip.poses), len(bodies), 3))
    for k, pose in enumerate(clip.poses):
        data.qpos = pose
        mujoco.mj_kinematics(MODEL, data)
        origins[k] = data.xpos[ids]
    return origins


def knee_flexion(clip):
    """Flexion of the left and the right knee [degrees], shape (n, 2)."""
    return np.rad2deg(rotation_vectors(clip)[:, [JOINTS.index("left_knee"), JOINTS.index("right_knee")], 1])


@each_clip
def test_committed_clip_matches_its_generator(name, clips):
    generated = CLIPS[name]()
    assert generated.fps == pytest.approx(clips[name].fps, rel=1e-9)
    assert np.abs(pose_difference(generated.poses, clips[name].poses)).max() < 1e-6


@each_clip
def test_clip_is_a_closed_lap_in_place_of_2_to_4_s(name, clips):
    clip = clips[name]
    assert 2.0 <= clip.duration <= 4.0
    assert clip.closes(1e-6)
    np.testing.assert_allclose([clip.displacement.x, clip.displacement.y, clip.displacement.yaw], 0.0, atol=1e-6)


@each_clip
def test_every_joint_stays_within_its_range(name, clips):
    vectors, limits = rotation_vectors(clips[name]), joint_range()
    assert np.all(vectors >= limits[..., 0])
    assert np.all(vectors <= limits[..., 1])


@each_clip
def test_feet_stay_above_the_floor_with_one_always_in_contact(name, motions):
    soles = motions[name].contacts[..., 2] - CONTACT_RADIUS
    assert soles.min() > -1e-3
    assert soles.min(axis=1).max() < 1e-3


@each_clip
def test_feet_on_the_floor_do_not_slide(name, motions):
    """From touch-down to lift-off a contact sphere stays within 2 cm."""
    contacts = motions[name].contacts
    touching = contacts[..., 2] < CONTACT_RADIUS + 3e-3
    for sphere in range(contacts.shape[1]):
        runs = np.split(np.arange(len(contacts)), np.flatnonzero(np.diff(touching[:, sphere])) + 1)
        for run in runs:
            if touching[run[0], sphere]:
                assert np.ptp(contacts[run, sphere, :2], axis=0).max() < 0.02


@each_clip
def test_zmp_support_and_friction_of_the_floor_suffice(name, motions):
    """The floor never has to pull, to exceed friction, or to push more than 1 cm outside the feet."""
    motion = motions[name]
    outside = distance_outside_support(motion)
    assert np.mean(outside < 1e-3) > 0.97
    assert outside.max() < 0.01
    assert motion.force[:, 2].min() > 0.4 * 75 * 9.81
    assert np.max(np.hypot(*motion.force[:, :2].T) / motion.force[:, 2]) < 0.5


@each_clip
def test_joint_velocity_acceleration_and_jerk_are_bounded(name, clips):
    velocity = clips[name].velocities()[:, 6:]
    acceleration = np.diff(velocity, axis=0) * clips[name].fps
    jerk = np.diff(acceleration, axis=0) * clips[name].fps
    assert np.abs(velocity).max() < 10  # [rad/s]
    assert np.abs(acceleration).max() < 250  # [rad/s²]
    assert np.abs(jerk).max() < 6000  # [rad/s³]: a sixtieth of a second apart, accelerations differ by less than 100


@each_clip
def test_arms_do_not_penetrate_the_body(name, clips):
    data = mujoco.MjData(MODEL)
    limbs = [f"{side}_{part}" for side in ("left", "right") for part in ("forearm", "hand", "thigh")]
    body_of = {g: MODEL.body(MODEL.geom_bodyid[g]).name for g in range(MODEL.ngeom) if MODEL.geom_group[g] != 3}
    shown = {body: [g for g, owner in body_of.items() if owner == body] for body in (*TRUNK, *limbs)}
    for pose in clips[name].poses[::3]:
        data.qpos = pose
        mujoco.mj_kinematics(MODEL, data)
        for side, other in (("left", "right"), ("right", "left")):
            for limb in (f"{side}_forearm", f"{side}_hand"):
                for body in (*TRUNK, f"{other}_forearm", f"{other}_hand", "left_thigh", "right_thigh"):
                    distance = min(
                        mujoco.mj_geomDistance(MODEL, data, a, b, 0.1, None) for a in shown[limb] for b in shown[body]
                    )
                    assert distance > -0.008, f"{limb} is {-distance:.3f} m inside {body}"


@pytest.mark.parametrize("name", IN_PLACE)
def test_in_place_clips_stay_near_the_origin_and_start_facing_forwards(name, clips):
    clip = clips[name]
    assert np.abs(clip.poses[:, :2]).max() < 0.2
    heading = Rotation.from_quat(clip.poses[0, 3:7], scalar_first=True).apply([1.0, 0.0, 0.0])
    assert heading[0] > np.cos(np.deg2rad(15))


def test_angry_points_with_one_arm_raises_the_fist_and_stamps(clips):
    hands = positions(clips["angry"], "right_hand", "left_hand", "chest", "head", "left_foot")
    right, left, chest, head, foot = hands.transpose(1, 0, 2)
    assert np.max(right[:, 0] - chest[:, 0]) > 0.5
    assert np.max(right[:, 2] - head[:, 2]) > 0.0
    assert np.max(left[:, 2] - chest[:, 2]) < 0.0
    assert np.ptp(chest[:, 0]) > 0.1
    assert np.ptp(foot[:, 2]) > 0.08


def test_cheer_raises_both_hands_overhead_three_times_and_bends_the_knees(clips):
    left, right, head = positions(clips["cheer"], "left_hand", "right_hand", "head").transpose(1, 0, 2)
    height = np.minimum(left[:, 2], right[:, 2]) - head[:, 2]
    assert np.sum(height[argrelmax(height, order=5)] > 0.35) == 3
    assert height.min() < -0.4
    assert np.ptp(knee_flexion(clips["cheer"])) > 35


def test_spin_turns_once_to_the_left_with_arms_out_in_eight_steps(clips, motions):
    clip = clips["spin"]
    turn = pose_difference(clip.poses[:-1], clip.poses[1:])[:, 5]
    assert turn.min() > 0
    assert turn.sum() == pytest.approx(2 * np.pi, rel=1e-2)
    left, right = positions(clip, "left_hand", "right_hand").transpose(1, 0, 2)
    assert np.linalg.norm(left - right, axis=1).min() > 1.0
    swings = motions["spin"].contacts[:, [3, 7], 2] > CONTACT_RADIUS + 0.02  # the inner toe contact of either foot
    assert np.sum(np.diff(swings.astype(int), axis=0) == 1) == 8


def test_squat_dance_stays_low_and_kicks_each_leg_twice_with_folded_arms(clips):
    clip = clips["squat_dance"]
    assert knee_flexion(clip).max(axis=1).min() > 85
    assert np.all(knee_flexion(clip).max(axis=0) > 100)
    left, right, pelvis = positions(clip, "left_foot", "right_foot", "pelvis").transpose(1, 0, 2)
    for foot, other in ((left, right), (right, left)):
        ahead = foot[:, 0] - pelvis[:, 0]
        kicks = argrelmax(ahead, order=5, mode="wrap")[0]
        kicks = kicks[ahead[kicks] > 0.6]
        assert len(kicks) == 2
        assert np.all(foot[kicks, 2] > 0.3)
        assert np.all(other[kicks, 2] < 0.08)
    hands = positions(clip, "left_hand", "right_hand", "chest").transpose(1, 0, 2)
    assert np.max(np.linalg.norm(hands[0] - hands[2], axis=1)) < 0.45
    assert np.max(np.linalg.norm(hands[1] - hands[2], axis=1)) < 0.45


def test_ginga_steps_back_with_each_foot_stays_low_and_kicks_to_hip_height(clips):
    clip = clips["ginga"]
    left, right, pelvis = positions(clip, "left_foot", "right_foot", "pelvis").transpose(1, 0, 2)
    assert left[:, 0].min() < -0.3
    assert right[:, 0].min() < -0.3
    kick = np.argmax(left[:, 2])
    assert left[kick, 2] > pelvis[kick, 2]
    assert left[kick, 0] - pelvis[kick, 0] > 0.7
    assert np.median(pelvis[:, 2]) < 0.8


def test_every_embedded_clip_has_a_generator_and_unknown_names_are_refused(capsys):
    assert set(embedded_names()) <= set(clip_generator.CLIPS)
    assert clip_generator.main(["angry", "happy"]) == 2
    message = capsys.readouterr().err
    assert "no clip happy" in message
    assert all(name in message for name in CLIPS)
