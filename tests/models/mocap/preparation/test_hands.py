"""Hands that bear load, on a body that rests on its toes and palms as for a push-up."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import (
    CONTACT_RADIUS,
    FOOT_CONTACTS,
    HAND_CONTACTS,
    JOINTS,
    N_TANGENT,
    figure_model,
    rest_pose,
)
from models.mocap.dynamics.contacts import HAND_REACH
from models.mocap.dynamics.floor_forces import ALL_CONTACTS, EDGES, Floor, residual
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import contact_points
from models.mocap.preparation import motion_errors
from models.mocap.preparation.change import DEGREE, Change
from models.mocap.preparation.contact_loads import contact_forces
from models.mocap.preparation.hand_stances import extend_hand_stances
from models.mocap.preparation.motion_errors import MotionErrors
from models.mocap.preparation.stances import stances
from models.mocap.preparation.well_formed import well_formed
from tests.models.mocap.preparation.push_up import PALMS, held, propped
from tools.clip_authoring.coordinates import poses as pose_of


@pytest.fixture(scope="module", name="held")
def push_up_of_half_a_second():
    return held(61)


def _demand(pose, spheres=ALL_CONTACTS):
    floor, still = Floor(spheres=spheres), np.zeros((1, N_TANGENT))
    return floor, floor.demand(pose[None], still, still)


def test_toes_and_palms_share_the_weight_by_their_lever_arms(held):
    """Moments about the line of the toes: the palms bear W (x_com − x_toes) / (x_palms − x_toes)."""
    floor, demand = _demand(held.poses[0])
    standing = contact_points(held.poses[:1], ALL_CONTACTS)[:, :, 2] < CONTACT_RADIUS + 1e-3
    grip = floor.grip(demand, standing)
    assert standing[0].sum() == 6
    np.testing.assert_allclose(residual(demand, grip)[0, :3], 0.0, atol=1e-3 * floor.body_weight)
    np.testing.assert_allclose(residual(demand, grip)[0, 3:], 0.0, atol=1e-3 * floor.body_weight)
    loads = (grip.reshape(10, 4) @ EDGES)[:, 2]
    toes, palms = demand.spheres[0, standing[0]][:4, 0].mean(), demand.spheres[0, PALMS, 0].mean()
    share = (demand.com[0, 0] - toes) / (palms - toes)
    assert 0.5 < share < 0.8
    assert loads[PALMS].sum() == pytest.approx(share * floor.body_weight, rel=2e-3)
    assert loads.sum() == pytest.approx(floor.body_weight, rel=2e-3)


def test_toes_alone_cannot_support_a_push_up(held):
    floor, demand = _demand(held.poses[0], FOOT_CONTACTS)
    standing = contact_points(held.poses[:1], FOOT_CONTACTS)[:, :, 2] < CONTACT_RADIUS + 1e-3
    missing = residual(demand, floor.grip(demand, standing))[0] / floor.body_weight
    assert np.linalg.norm(missing * (1, 1, 1, 2, 2, 2)) > 0.5


def test_levers_match_mujoco_jacobians():
    model, rng = figure_model(), np.random.default_rng(5)
    data, pose = mujoco.MjData(model), rest_pose()
    mujoco.mj_integratePos(model, pose, 0.5 * rng.normal(size=N_TANGENT), 1.0)
    levers = _demand(pose)[1].levers()[0].reshape(N_TANGENT - 6, len(ALL_CONTACTS), 4)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    for k, name in enumerate(ALL_CONTACTS):
        geom, jacobian = model.geom(name).id, np.zeros((3, N_TANGENT))
        below = data.geom_xpos[geom] - (0.0, 0.0, CONTACT_RADIUS)
        mujoco.mj_jac(model, data, jacobian, None, below, int(model.geom_bodyid[geom]))
        np.testing.assert_allclose(levers[:, k], (EDGES @ jacobian[:, 6:]).T, atol=1e-12)


def test_push_up_has_toes_and_palms_in_its_contact_schedule(held):
    schedule = stances(held, held)
    assert schedule.hands.all()
    np.testing.assert_allclose(schedule.places[:, PALMS, 2], CONTACT_RADIUS)
    support = contact_forces(held, schedule)
    assert support.residual < 2e-3
    assert support.loads.sum(axis=1) == pytest.approx(1.0, abs=5e-3)
    assert well_formed(held, ()).residual < 2e-3


@pytest.mark.parametrize("lift", [-0.05, 0.05])
def test_palms_5_cm_above_or_below_the_floor_are_placed_on_it(lift):
    """Captures with fixed wrists have such palms; the body is pitched about its toes."""
    u = propped(np.deg2rad(85.0))
    toes, palms = (contact_points(pose_of(u)[None], names)[0] for names in (FOOT_CONTACTS, HAND_CONTACTS))
    turn = -lift / (palms[0, 0] - toes[2, 0])
    u[4] += turn
    u[2] -= contact_points(pose_of(u)[None], FOOT_CONTACTS)[0, :, 2].min() - CONTACT_RADIUS
    assert contact_points(pose_of(u)[None], HAND_CONTACTS)[0, 0, 2] - CONTACT_RADIUS == pytest.approx(lift, abs=5e-3)
    off = Clip(np.tile(pose_of(u), (61, 1)), 120.0, "off")
    schedule = stances(off, off)
    assert schedule.hands.all()
    np.testing.assert_allclose(schedule.places[:, PALMS, 2], CONTACT_RADIUS)


def test_hands_near_the_floor_bear_no_load_in_a_squat_on_the_feet():
    """A squat on flat feet, palms hanging 8 cm above the floor."""
    u, bends = np.zeros(N_TANGENT), {"abdomen": 15.0, "chest": 15.0}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        bends |= {f"{side}_hip": -120.0, f"{side}_knee": 160.0, f"{side}_ankle": -40.0}
        u[6 + 3 * JOINTS.index(f"{side}_shoulder")] = -sign * np.deg2rad(90.0)
    for joint, angle in bends.items():
        u[6 + 3 * JOINTS.index(joint) + 1] = np.deg2rad(angle)
    u[2] = CONTACT_RADIUS - contact_points(pose_of(u)[None], FOOT_CONTACTS)[0, :, 2].min()
    heights = contact_points(pose_of(u)[None], ALL_CONTACTS)[0, :, 2] - CONTACT_RADIUS
    np.testing.assert_allclose(heights[: PALMS.start], 0.0, atol=1e-9)
    np.testing.assert_allclose(heights[PALMS], 0.083, atol=1e-3)
    squat = Clip(np.tile(pose_of(u), (61, 1)), 120.0, "squat")
    assert stances(squat, squat).hands.shape == (61, 0)


@pytest.mark.parametrize("name", ["walk", "run", "backflip", "ginga"])
def test_motions_on_feet_have_no_hands_in_their_contact_schedule(name):
    clip = embedded(name)
    assert stances(clip, clip).hands.shape == (clip.n_frames, 0)


def test_hand_stance_is_extended_where_nothing_else_bears_load():
    """The left hand stands up to frame 10, and rises above its reach, after 17 far above it; the right one stands from
    30 and slides by 20 cm up to 25."""
    palms, hands = np.full((40, 2, 3), CONTACT_RADIUS), np.zeros((40, 2), dtype=bool)
    hands[:10, 0] = hands[30:, 1] = True
    palms[10:17, 0, 2] += HAND_REACH + 0.02
    palms[17:, 0, 2] += 0.3
    palms[:25, 1, 0] = 0.2
    extend_hand_stances(palms, hands, 10, 30, 0.15)
    np.testing.assert_array_equal(np.flatnonzero(hands[:, 0]), np.arange(17))
    np.testing.assert_array_equal(np.flatnonzero(hands[:, 1]), np.arange(25, 40))


def test_error_jacobian_with_loaded_hands_matches_central_differences(monkeypatch):
    """Differences along a random change, with a torque bound so low that arms and trunk contribute."""
    monkeypatch.setattr(motion_errors, "_STRAIN_THRESHOLD", 0.02)
    arms = np.deg2rad(85.0) - 0.15 * np.sin(np.linspace(0.0, np.pi, 40)) ** 2
    clip = Clip(np.array([pose_of(propped(angle)) for angle in arms]), 60.0, "push-up")
    schedule, change = stances(clip, clip), Change(clip, 0.1, 0.05, passage=True)
    assert schedule.hands.all()
    problem, rng = MotionErrors(change, schedule), np.random.default_rng(6)
    x, direction = 1e-3 * rng.normal(size=(2, change.n_points * N_TANGENT)) * ((1.0,), (1e3,))
    errors = problem.at(x, True)
    assert (errors.grip[:, 4 * PALMS.start :].sum(axis=1) > 0.1 * problem.floor.body_weight).all()
    points = change.points(direction.reshape(-1, N_TANGENT))[change.first[:, None] + np.arange(DEGREE + 1)]
    parts = np.stack([np.einsum("mk,mkn->mn", change.basis[order], points) for order in range(3)], axis=1)
    analytic = np.einsum("mofn,mon->mf", errors.jacobian, parts)
    ahead, behind = (problem.at(x + sign * 1e-6 * direction, False).weighted for sign in (1, -1))
    numeric = (ahead - behind) / 2e-6
    assert np.quantile(np.abs(analytic - numeric) / (np.abs(numeric).max(axis=0) + 1.0), 0.99) < 0.02
