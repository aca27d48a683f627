"""Walk and run: the measures of a gait laboratory, on the committed clips."""

import numpy as np
import pytest
from clip_measures import G, acceleration, measured, tangent_derivative

from geometry.arrays import rms
from models.humanoid.skeleton import BODIES, FOOT_CONTACTS, JOINTS
from models.mocap.library import embedded
from tools.clip_authoring import gait
from tools.clip_authoring.coordinates import coordinate
from tools.clip_authoring.spacetime import Motion

GAITS = {"walk": gait.WALK, "run": gait.RUN}
LEFT = slice(0, 4)
RIGHT = slice(4, 8)


@pytest.fixture(scope="module", params=sorted(GAITS))
def name(request):
    return request.param


def joint_angle(clip, joint, axis):
    """Component of a joint's rotation vector over one cycle [degrees]."""
    first = 7 + 4 * JOINTS.index(joint)
    q = clip.poses[:, first : first + 4]
    q = np.where(q[:, :1] < 0, -q, q)
    angle = 2 * np.arctan2(np.linalg.norm(q[:, 1:], axis=1), q[:, 0])
    return np.rad2deg(angle) * q[:, 1 + "xyz".index(axis)] / np.maximum(np.linalg.norm(q[:, 1:], axis=1), 1e-12)


def test_goes_straight_ahead_at_its_speed_and_closes(name):
    clip, planned = embedded(name), GAITS[name]
    assert clip.closes(1e-6)
    assert clip.fps == gait.FPS
    assert clip.displacement.x / clip.duration == pytest.approx(planned.speed, rel=1e-4)
    assert abs(clip.displacement.y) < 1e-6
    assert abs(clip.displacement.yaw) < 1e-6


def test_second_step_mirrors_the_first(name):
    m, half = measured(name), round(GAITS[name].period * gait.FPS / 2)
    ahead = np.array([GAITS[name].speed * GAITS[name].period / 2, 0, 0])
    left, right = m.soles[:-half, LEFT], m.soles[half:, RIGHT]
    np.testing.assert_allclose(right - ahead, left * (1, -1, 1), atol=1e-6)


def test_accelerations_change_little_from_frame_to_frame(name):
    clip = embedded(name)
    magnitude = np.abs(tangent_derivative(clip, 2))
    change = np.abs(np.diff(tangent_derivative(clip, 2), axis=0))
    assert change.max() < 0.35 * magnitude.max()


def test_walk_has_double_support_and_never_flies():
    touching = measured("walk").touching
    left, right = touching[:, LEFT].any(axis=1), touching[:, RIGHT].any(axis=1)
    assert (left | right).all()
    assert 0.15 < (left & right).mean() < 0.35


def test_walk_strikes_with_the_heel_and_leaves_with_the_toe():
    touching = measured("walk").touching
    heel, toe = touching[:, :2].any(axis=1), touching[:, 2:4].any(axis=1)
    change = np.diff((heel | toe).astype(int))
    down, up = np.flatnonzero(change == 1) + 1, np.flatnonzero(change == -1)
    assert len(down) >= 1
    assert len(up) >= 1
    assert heel[down].all()
    assert not toe[down].any()
    assert toe[up].all()
    assert not heel[up].any()


def test_walk_vertical_floor_force_peaks_and_dips_in_the_normal_range():
    force = acceleration(measured("walk"))[:, 2] / G + 1
    half = round(gait.WALK.period * gait.FPS / 2)
    step = force[:half]
    assert 1.05 < step.max() < 1.5
    assert 0.6 < step.min() < 0.95
    assert step.mean() == pytest.approx(1.0, abs=0.02)


def test_walk_centre_of_mass_moves_vertically_and_sideways_as_in_people():
    com = measured("walk").com
    assert 0.015 < np.ptp(com[:, 2]) < 0.06
    assert 0.015 < np.ptp(com[:, 1]) < 0.07


def test_run_flies_between_steps_and_falls_with_g():
    m = measured("run")
    air = ~m.touching.any(axis=1)
    assert 0.15 < air.mean() < 0.45
    inner = air[3:-3] & air[2:-4] & air[4:-2] & air[1:-5] & air[5:-1]
    fall = acceleration(m)[2:-2][inner] + np.array([0, 0, G])
    assert len(fall) > 20
    assert np.abs(fall).max() < 0.02 * G
    assert not (m.touching[:, LEFT].any(axis=1) & m.touching[:, RIGHT].any(axis=1)).any()


@pytest.mark.parametrize(("joint", "sign"), [("hip", -1), ("knee", 1), ("ankle", -1)])
def test_joint_angles_follow_the_published_curves(name, joint, sign):
    clip, planned = embedded(name), GAITS[name]
    phase = np.arange(20) / 20
    frames = np.round(phase * planned.period * gait.FPS).astype(int)
    angle = sign * joint_angle(clip, f"left_{joint}", "y")[frames]
    curve = np.array(getattr(planned, joint))
    assert rms(angle - curve) < 8.0
    assert np.corrcoef(angle, curve)[0, 1] > 0.9


def test_arms_swing_against_the_legs_and_elbows_bend_forwards_only(name):
    clip, bodies = embedded(name), measured(name).bodies

    def ahead(body):
        return bodies[:, 1 + BODIES.index(body), 0] - bodies[:, 1, 0]

    assert np.corrcoef(ahead("left_hand"), ahead("left_foot"))[0, 1] < -0.8
    assert np.corrcoef(ahead("left_hand"), ahead("right_foot"))[0, 1] > 0.8
    assert joint_angle(clip, "left_elbow", "z").max() < -5
    assert joint_angle(clip, "right_elbow", "z").min() > 5


def test_walk_spline_repeats_mirrored_after_half_a_period():
    task = gait.task(gait.WALK)
    motion = Motion(task)
    motion.unknowns += 0.01 * np.random.default_rng(1).standard_normal(len(motion.unknowns))
    u = motion.coordinates(np.array([0.1, 0.1 + gait.WALK.period / 2, 0.1 + gait.WALK.period]))
    assert u[1, coordinate("right_knee", "y")] == pytest.approx(u[0, coordinate("left_knee", "y")])
    assert u[1, coordinate("root", "z")] == pytest.approx(-u[0, coordinate("root", "z")])
    np.testing.assert_allclose(u[2, 1:], u[0, 1:], atol=1e-12)
    assert len(task.stances) == 2 * len(FOOT_CONTACTS)


@pytest.mark.slow
def test_committed_clip_matches_its_generator(name):
    generated, committed = gait.CLIPS[name](), embedded(name)
    assert generated.poses.shape == committed.poses.shape
    # Other BLAS kernels round differently; they changed the run by 2e-7.
    np.testing.assert_allclose(generated.poses, committed.poses, atol=1e-5)
