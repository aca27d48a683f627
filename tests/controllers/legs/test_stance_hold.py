"""Standing feet keep their position: held at the touching points, released in the air, unchanged for a single clip."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.haptic_map.lifted import Lifted
from controllers.legs.stance_hold import advance_hand, carry_root, fresh_footing, hold_stance_foot, mixing_degree
from controllers.motion.lap import MEMORY
from tests.controllers.clips_for_maps import LEG, difference, matrices, numeric_jacobian, stylus, swinging, wxyz
from tests.controllers.example_maps import ring

SOLE = LEG.points - LEG.points.mean(axis=0)
FLAT = -float(SOLE[:, 2].min())  # height of the centre of a sole that lies flat
TURN = 2.0 * np.pi


def corrected(path, mixture=1.0, frame=(0.0, 0.0, 0.0), angles=None):
    """Offsets (n, 3) and positions of the sole's points (n, k, 3), in the frame, of an end requested along a path.

    A row of the path: x, y, height of the lowest point, heading, roll about the foot's length.
    """
    footing, offsets, points = fresh_footing(1), [], []
    angles = 0.01 * np.arange(len(path)) if angles is None else angles
    mixtures = np.broadcast_to(mixture, len(path))
    for (x, y, z, heading, roll), angle, mixed in zip(path, angles, mixtures, strict=True):
        turn = Rotation.from_euler("zx", [heading, roll])
        end, q = np.array([x, y, z - turn.apply(SOLE)[:, 2].min()]), wxyz(turn)
        hold_stance_foot(
            footing, 0, advance_hand(footing, np.mod(angle, TURN)), mixed, SOLE, 0.0, np.array(frame), end, q
        )
        offsets.append(footing[3:6].copy())
        points.append(end + SOLE @ matrices(q).T)
    return np.array(offsets), np.array(points)


def path(n, **columns):
    rows = np.zeros((n, 5))
    for k, name in enumerate(("x", "y", "z", "heading", "roll")):
        rows[:, k] = columns.get(name, 0.0)
    return rows


S = np.linspace(0.0, 1.0, 200)
DRAGGED = path(200, x=0.01 * S, y=-0.02 * S**2, heading=0.1 * S)


@pytest.mark.parametrize("frame", [(0.0, 0.0, 0.0), (3.0, -1.0, 2.0)])
def test_standing_foot_stays_where_it_landed(frame):
    offsets, points = corrected(DRAGGED, frame=frame)
    # Dragged by 2 cm and 6°; the bound on offsets leaves a fiftieth of it.
    assert np.abs(points - points[0]).max() < 1e-3
    np.testing.assert_allclose(offsets[-1, :2], -DRAGGED[-1, :2], atol=1e-3)


def test_foot_may_roll_over_its_edge():
    # Rolled by 0.5 rad about its length round the touching points, which stay where they are.
    roll = 0.5 * S
    edge = np.array([Rotation.from_rotvec([r, 0.0, 0.0]).apply(SOLE[2]) for r in roll])
    rolling = path(200, x=-edge[:, 0], y=-edge[:, 1], roll=roll)
    offsets, points = corrected(rolling[20:])
    assert np.abs(offsets).max() < 1e-3
    assert np.abs(points[:, 2, :2] - points[0, 2, :2]).max() < 1e-3


def test_single_clip_and_airborne_foot_are_unchanged():
    for mixture, height in ((0.0, 0.0), (1.0, 0.01)):
        offsets, _ = corrected(DRAGGED + path(200, z=height), mixture)
        np.testing.assert_array_equal(offsets, 0.0)


def test_mixed_is_zero_for_one_dominant_weight():
    assert mixing_degree(np.array([1.0, 0.0, 0.0])) == mixing_degree(np.array([0.9995, 0.0005])) == 0.0
    assert mixing_degree(np.array([0.5, 0.5])) == mixing_degree(np.array([0.9, 0.1])) == 1.0
    assert 0.0 < mixing_degree(np.array([0.97, 0.03])) < 1.0
    # Beyond a clip the other one has a negative weight: that is no clip alone either.
    assert mixing_degree(np.array([1.1, -0.1])) == 1.0


def test_foot_that_landed_in_a_mixture_stays_until_it_is_lifted_though_a_clip_is_alone_by_then():
    """The mixture ends half way through a stance; then the foot swings for half a lap, and stands again."""
    stance, swing = path(100, x=0.1 * np.linspace(0.0, 1.0, 100)), path(300, x=0.1, z=0.03)
    mixture = np.concatenate([np.linspace(1.0, 0.0, 50), np.zeros(450)])
    offsets, points = corrected(np.concatenate([stance, swing, stance]), mixture)
    assert np.abs(points[:100] - points[0]).max() < 0.015
    assert np.linalg.norm(offsets[399]) < 1e-6
    # In the next stance the clip alone moves its foot by 10 cm, as it does without a footing.
    assert points[499, 0, 0] - points[400, 0, 0] > 0.099


def test_held_offset_decays_in_the_air_and_is_restored_on_the_way_back():
    lifted = path(200, x=0.01, z=0.02)
    there = np.concatenate([path(200, x=0.01 * S), lifted])
    angles = np.concatenate([np.zeros(200), 0.004 * np.arange(200)])
    offsets, points = corrected(there, angles=angles)
    held = offsets[199, 0]
    assert held == pytest.approx(-0.01, rel=0.02)
    np.testing.assert_allclose(offsets[200:, 0], held * np.exp(-5.0 * angles[200:]), rtol=1e-9)
    assert abs(points[-1, 0, 0] - points[0, 0, 0] - 0.01) < 3e-4
    back = np.concatenate([angles, angles[-1] - 0.004 * np.arange(1, 30)])
    offsets, _ = corrected(np.concatenate([there, lifted[:29]]), angles=back)
    np.testing.assert_allclose(offsets[-1], offsets[-59], rtol=1e-9)


def test_progress_follows_the_hands_reversal():
    footing = fresh_footing(1)
    assert advance_hand(footing, 1.0) == 0.0
    assert advance_hand(footing, 1.1) == pytest.approx(0.1)
    assert advance_hand(footing, 1.0) == pytest.approx(-0.1)
    assert advance_hand(footing, 0.9) == pytest.approx(-0.1)
    assert advance_hand(footing, 0.8) == pytest.approx(0.1)
    # Also over the seam.
    assert advance_hand(footing, TURN - 0.1) == pytest.approx(0.9)


def test_differences_from_one_memory_converge_to_velocity_and_acceleration():
    """As for the figure's reference: one tick forwards and backwards from the same memory, while a foot lands."""

    def requested(t):
        return 0.02 * np.sin(3.0 * t), 0.01 * t**2, 0.0045 - 0.004 * t, 0.2 * t, 0.0

    def step(footing, t):
        x, y, z, heading, roll = requested(t)
        turn = Rotation.from_euler("zx", [heading, roll])
        end, q = np.array([x, y, z - turn.apply(SOLE)[:, 2].min()]), wxyz(turn)
        hold_stance_foot(footing, 0, advance_hand(footing, 1.0 + t), 1.0, SOLE, 0.0, np.zeros(3), end, q)
        return end

    def measured(tick):
        footing, ends = fresh_footing(1), []
        for k in range(-round(0.08 / tick), 1):
            ends.append(step(footing, tick * k))
        after, before = (step(footing.copy(), sign * tick) for sign in (1.0, -1.0))
        return (after - before) / (2.0 * tick), (after + before - 2.0 * ends[-1]) / tick**2

    coarse, fine = measured(2e-3), measured(2.5e-4)
    for a, b in zip(coarse, fine, strict=True):
        assert np.abs(b).max() > 0.01
        np.testing.assert_allclose(a, b, atol=0.02 * np.abs(b).max())


def test_root_follows_its_standing_feet_and_a_step_back_undoes_it():
    footing = fresh_footing(2)
    states = footing[3:].reshape(2, -1)
    states[0, :2], states[0, 10] = (0.1, -0.02), 1.0  # stands
    states[1, :2], states[1, 10] = (-0.3, 0.5), 0.0  # swings
    before = states[:, :2].copy()
    shift = np.array(carry_root(footing, 2, 0.2))
    # Half of a relaxation of the standing foot's offset with 0.5 a radian; the swinging foot's place stays, too.
    np.testing.assert_allclose(shift, before[0] * (1.0 - np.exp(-0.05)), rtol=1e-12)
    np.testing.assert_allclose(states[:, :2] + shift, before, rtol=1e-12)
    np.testing.assert_allclose(shift + carry_root(footing, 2, -0.2), 0.0, atol=1e-15)
    np.testing.assert_allclose(states[:, :2], before, rtol=1e-12)
    # Of two standing feet the mean counts.
    states[1, 10] = 1.0
    np.testing.assert_allclose(carry_root(footing, 2, 0.2), before.mean(axis=0) * (1.0 - np.exp(-0.05)), rtol=1e-12)


CLIPS = [(swinging(k, 120, travel=0.4 * k), 30.0) for k in (1, 2, 3)]
MAP = Lifted(CLIPS, [True] * 3, [TURN * np.linspace(0.0, 1.0, 121)] * 3, ring(3), [LEG])


@pytest.mark.slow
def test_jacobian_matches_finite_differences_at_a_given_offset():
    rng = np.random.default_rng(3)
    for r, angle, z in rng.uniform([0.035, 0.1, -0.015], [0.065, 6.1, 0.015], (40, 3)):
        memory = MAP.compiled().memory
        memory[MEMORY + 3 : MEMORY + 6] = rng.uniform(-0.04, 0.04, 3)
        x = stylus(r, angle, z)
        jacobian = MAP.jacobian(x, memory.copy())
        assert np.abs(difference(MAP.pose(x, memory.copy()), MAP.pose(x))).max() > 1e-3
        numeric = numeric_jacobian(MAP, x, 1e-6, memory)
        assert np.abs(numeric - jacobian[:, :3]).max() < 1e-6 * np.abs(jacobian).max()
