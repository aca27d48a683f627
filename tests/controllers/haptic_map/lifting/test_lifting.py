"""Lifting: features of motions, the common lap, transitions, the arrangement and validation."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.arrangement import arrange, is_apart
from controllers.haptic_map.lifting.arrangement_energy import N_ANGLES, N_ROWS, Energy, Task, evaluate_sites
from controllers.haptic_map.lifting.common_lap import N_SAMPLES, common_lap
from controllers.haptic_map.lifting.layouts import lattice, scaled
from controllers.haptic_map.lifting.lift import lift
from controllers.haptic_map.lifting.motion_features import Features, Motion, features
from controllers.haptic_map.lifting.room import Rectangle, Room
from controllers.haptic_map.lifting.transitions import Transition, compare, find_transitions
from tests.controllers.clips_for_maps import JOINTS, difference, swinging, wxyz
from tests.derivatives import central_differences

WEIGHTS = np.array([0.4, 0.2, 0.15, 0.1])
ROOM = Room()


def motion(poses, name="clip", fps=30.0, closed=True, supports=None):
    return Motion(poses, fps, name, closed, np.ones((len(poses), 2), bool) if supports is None else supports)


def lifted_at(motions, room=ROOM, seed=1):
    return lift(motions, WEIGHTS, room, np.random.default_rng(seed))


FOUR = [motion(swinging(k, frames=60 + 20 * k, amplitude=0.3 + 0.2 * k), f"clip {k}") for k in range(4)]


@cache
def four_lifted():
    return lifted_at(FOUR)


def test_distance_of_close_poses_equals_their_weighted_tangent():
    rng = np.random.default_rng(0)
    poses = swinging(1, frames=8)
    nearby = poses.copy()
    nearby[:, 2] += 1e-4 * rng.normal(size=9)
    for first in range(7, 19, 4):
        turn = Rotation.from_rotvec(1e-4 * rng.normal(size=(9, 3)))
        nearby[:, first : first + 4] = wxyz(Rotation.from_quat(np.roll(poses[:, first : first + 4], -1, axis=1)) * turn)
    here, there = (features(motion(p), WEIGHTS, 9).pose for p in (poses, nearby))
    for k in range(9):
        tangent = difference(nearby[k], poses[k])
        turns = WEIGHTS[1:, None] * tangent[6:].reshape(JOINTS, 3)
        expected = np.sqrt(tangent[2] ** 2 + (turns**2).sum())
        assert np.linalg.norm(there[k] - here[k]) == pytest.approx(expected, rel=1e-6)


def test_features_do_not_depend_on_position_and_heading():
    poses = swinging(2, travel=1.0)
    moved, turn = poses.copy(), Rotation.from_rotvec([0.0, 0.0, 2.1])
    moved[:, :3] = turn.apply(poses[:, :3]) + np.array([3.0, -1.0, 0.0])
    moved[:, 3:7] = wxyz(turn * Rotation.from_quat(np.roll(poses[:, 3:7], -1, axis=1)))
    for here, there in zip(*(features(motion(p), WEIGHTS, 50) for p in (poses, moved)), strict=True):
        np.testing.assert_allclose(there, here, atol=1e-9)


def test_feature_velocities_match_differences_of_poses():
    poses = swinging(3, frames=240)
    own = features(motion(poses), WEIGHTS, 241)
    step = np.array([difference(poses[k + 1], poses[k - 1]) * 15.0 for k in range(1, 240)])
    spin = (step[:, 3:].reshape(239, -1, 3) * WEIGHTS[:, None]).reshape(239, -1)
    np.testing.assert_allclose(own.velocity[1:-1, 3:], spin, atol=2e-3)
    assert np.linalg.norm(own.velocity[120, :3]) == pytest.approx(np.linalg.norm(step[119, :3]), rel=1e-2)


def test_common_lap_removes_a_phase_shift():
    clips = [motion(swinging(5), "a"), motion(swinging(5, phase=0.3), "b")]
    a, b = common_lap(clips, [features(m, WEIGHTS, N_SAMPLES) for m in clips])
    # b at share s is a at s + 0.3.
    lag = np.mod(a.share(np.array([0.2])) - b.share(np.array([0.2])), 1.0)
    assert lag == pytest.approx(0.3, abs=0.5 / 96)


def test_common_lap_removes_a_time_warp():
    even = swinging(6, frames=200)
    s = np.linspace(0.0, 1.0, 201)
    late = s - 0.05 * np.sin(2.0 * np.pi * s)
    warped = np.stack([np.interp(late, s, column) for column in even.T], axis=1)
    warped[:, 3:] /= np.repeat(np.linalg.norm(warped[:, 3:].reshape(201, -1, 4), axis=2), 4, axis=1)
    clips = [motion(even, "even"), motion(warped, "late")]
    a, b = common_lap(clips, [features(m, WEIGHTS, N_SAMPLES) for m in clips])
    lap = np.arange(96) / 96
    error = np.interp(np.mod(b.share(lap), 1.0), s, late) - np.mod(a.share(lap), 1.0)
    error -= np.round(error)
    # Unwarped it would be 0.05.
    assert np.abs(error).max() < 0.02


def test_common_lap_aligns_clips_by_contacts_where_poses_are_equal():
    """Two clips of a still figure that differ in their contacts alone."""
    still = np.tile(swinging(1)[:1], (101, 1))
    s = np.linspace(0.0, 1.0, 101)
    walks = []
    for name, lead in (("a", 0.0), ("b", 0.35)):
        left = np.mod(s + lead, 1.0) < 0.5
        walks.append(motion(still, name, supports=np.stack([left, ~left], axis=1)))
    a, b = common_lap(walks, [features(m, WEIGHTS, N_SAMPLES) for m in walks])
    lap = np.arange(96) / 96
    stands = [np.mod(phase.share(lap) + lead, 1.0) < 0.5 for phase, lead in ((a, 0.0), (b, 0.35))]
    assert np.mean(stands[0] == stands[1]) > 0.97


def test_angles_increase_and_leave_a_gap_for_open_clips():
    clips = [*FOUR[:2], motion(swinging(3)[:70], "open", closed=False)]
    found = lifted_at(clips)
    for clip, angles in zip(clips, found.angles, strict=True):
        assert angles.shape == (len(clip.poses),)
        assert (np.diff(angles) > 0.0).all()
        if clip.closed:
            assert angles[-1] - angles[0] == pytest.approx(2.0 * np.pi, abs=1e-12)
        else:
            assert angles[0] > 0.0
            assert 2.0 * np.pi * 0.7 - 1e-9 <= angles[-1] - angles[0] <= 2.0 * np.pi * 0.9 + 1e-9
            assert angles[-1] < 2.0 * np.pi
    # Pace and its change are continuous: third differences are small relative to the step.
    step = np.diff(found.angles[0])
    assert np.abs(np.diff(step, 2)).max() < 0.02 * step.mean()


def clips_that_meet_once():
    """Two motions that differ except at one moment, at which pose and velocity are the same."""
    s = np.linspace(0.0, 1.0, 121)
    base = swinging(7, amplitude=0.2)
    other = base.copy()
    bump = np.sin(np.pi * (s - 0.4)) ** 4
    turn = Rotation.from_rotvec(np.outer(bump, [0.0, 1.2, 0.3]))
    other[:, 7:11] = wxyz(Rotation.from_quat(np.roll(base[:, 7:11], -1, axis=1)) * turn)
    return motion(base, "base"), motion(other, "other")


def test_transition_is_found_where_two_motions_agree_and_the_curves_meet_only_there():
    found = lifted_at(clips_that_meet_once())
    (transition,) = found.transitions
    base = common_lap([clips_that_meet_once()[0]], [features(clips_that_meet_once()[0], WEIGHTS, N_SAMPLES)])[0]
    assert base.start == 0.0
    assert np.hypot(transition.pose, transition.velocity) < 0.1
    assert transition.support == 0.0
    share = np.interp(transition.angle, found.angles[0], np.linspace(0.0, 1.0, 121))
    assert share == pytest.approx(0.4, abs=0.1)
    (meeting,) = found.after.meetings
    assert meeting.distance < 5e-3
    assert np.degrees(meeting.slant) < 10.0
    assert found.after.separation >= ROOM.separation
    # Before the arrangement the curves were far apart there too.
    assert found.before.meetings[0].distance > 5.0 * meeting.distance


def features_of(rng, poses, stands):
    """Features of a motion at 200 steps of a lap, from its distance to another and the contacts of one foot."""
    own = rng.normal(size=(200, 6))
    own[:, 0] += poses
    return Features(own, np.tile([1.5, 0.0, 0.0, 0.5], (200, 1)), np.asarray(stands, float)[:, None])


def test_transition_needs_agreement_for_a_while_on_the_same_feet():
    steps, feet = np.arange(200), np.arange(200) % 100 < 50

    def transitions(distances, stands):
        rng = np.random.default_rng(3)
        one, other = features_of(rng, 0.0 * steps, feet), features_of(np.random.default_rng(3), distances, stands)
        return find_transitions(compare([one, other], np.ones((200, 2), bool), np.full(2, 2.0)), 0.5)

    # The same pose for a moment at step 40, nearly the same for 0.4 s about step 120.
    distances = np.full(200, 6.0)
    distances[40], distances[95:146] = 0.0, 0.5
    (transition,) = transitions(distances, feet)
    assert np.degrees(transition.angle) == pytest.approx(120 * 1.8, abs=10.0)
    assert transition.support == 0.0
    assert transition.speeds == pytest.approx((1.5, 1.5))
    # With another foot on the floor there is no transition.
    other = feet.copy()
    other[80:160] = ~feet[80:160]
    assert transitions(distances, other) == []


def test_motions_that_never_agree_have_no_transition():
    upright = motion(swinging(1), "low")
    bent = swinging(1)
    bent[:, 7:11] = wxyz(Rotation.from_quat(np.roll(bent[:, 7:11], -1, axis=1)) * Rotation.from_rotvec([0.0, 2.0, 0.0]))
    assert lifted_at([upright, motion(bent, "bent")]).transitions == ()


def random_task(distance, speed, acceleration):
    """Four clips with two transitions; at several rad/s, the given limits may be exceeded."""
    rng = np.random.default_rng(1)
    return Task(
        Rectangle(0.02, 0.07, -0.05, 0.05), 0.01, 0.002, speed, acceleration, distance,
        [Transition(0, 1, 1.0, 0.0, 0.0, 0.0, (0.0, 0.0)), Transition(1, 2, 3.0, 0.0, 0.0, 0.0, (0.0, 0.0))],
        6.0 + rng.normal(size=(N_ANGLES, 4)), rng.normal(size=(N_ANGLES, 4)),
    )  # fmt: skip


def random_distances():
    distance = 0.1 * np.abs(np.random.default_rng(0).normal(size=(N_ANGLES, 4, 4)))
    return distance + distance.transpose(0, 2, 1)


def test_energy_gradient_matches_finite_differences():
    rng, distance = np.random.default_rng(0), random_distances()
    task = random_task(distance, 0.1, 0.5)
    energy = Energy(task)
    start = np.tile(scaled(task.scale * distance.mean(axis=0), np.arange(4.0), task.rectangle), (N_ROWS, 1, 1))
    x = (start + 2e-3 * rng.normal(size=start.shape)).ravel()
    gradient = energy(x).gradient
    for _ in range(5):
        direction = rng.normal(size=x.size)
        slope = central_differences(lambda h, direction=direction: energy(x + h * direction).value, 0.0, 1e-7)
        assert gradient @ direction == pytest.approx(slope, rel=1e-6)


def test_energy_curvature_is_its_hessian_where_the_sites_are_farther_apart_than_wanted():
    """Equal motions are wanted as near each other as they may be; limits are exceeded."""
    rng = np.random.default_rng(2)
    energy = Energy(random_task(np.zeros((N_ANGLES, 4, 4)), 0.1, 0.5))
    corners = np.array([[0.025, -0.04], [0.065, -0.04], [0.025, 0.04], [0.065, 0.04]])
    x = (np.tile(corners, (N_ROWS, 1, 1)) + 1e-3 * rng.normal(size=(N_ROWS, 4, 2))).ravel()
    curvature = energy(x).curvature
    for _ in range(5):
        direction = rng.normal(size=x.size)
        bent = central_differences(lambda h, direction=direction: energy(x + h * direction).gradient, 0.0, 1e-7)
        np.testing.assert_allclose(curvature @ direction, bent, rtol=1e-5, atol=1e-6 * np.abs(bent).max())


def test_energy_curvature_is_positive_semidefinite_where_sites_are_too_near():
    rng = np.random.default_rng(3)
    energy = Energy(random_task(random_distances(), 0.1, 0.5))
    x = (np.array([0.045, 0.0]) + 5e-3 * rng.normal(size=(N_ROWS, 4, 2))).ravel()
    curvature = energy(x).curvature
    values = np.linalg.eigvalsh(curvature)
    np.testing.assert_allclose(curvature, curvature.T, atol=1e-9 * values[-1])
    assert values[0] > -1e-12 * values[-1]


def test_arrangement_does_not_depend_on_the_starts():
    """All of them reach the same energy: rounding, in which processors differ, cannot choose another minimum."""
    task, values = random_task(random_distances(), 1.0, 8.0), list[float]()
    for seed in range(2):
        controls, _ = arrange(task, np.random.default_rng(seed))
        values.append(Energy(task)(controls.ravel()).value)
    assert values == pytest.approx([values[0]] * 2, rel=1e-6)


def test_sites_stay_inside_and_apart_and_arrangement_reduces_stress():
    lifted = four_lifted()
    low, high = ROOM.rectangle.low, ROOM.rectangle.high
    assert (lifted.sites >= low - 1e-12).all()
    assert (lifted.sites <= high + 1e-12).all()
    assert lifted.after.separation >= ROOM.separation
    assert lifted.after.stress < lifted.before.stress


def test_reported_curve_figures_match_those_of_the_map():
    """Independent computation: the trajectories of the map made from the lifted clips."""
    lifted = four_lifted()
    h = Lifted([(m.poses, m.fps) for m in FOUR], [True] * 4, lifted.angles, lifted.sites)
    for i, curve in enumerate(lifted.after.curves):
        path = h.curve(i)
        t = np.linspace(path.start, path.end, 800)
        assert np.linalg.norm(path.velocity(t), axis=1).max() == pytest.approx(curve.speed, rel=0.02)
        assert 1.0 / path.curvature(t).max() == pytest.approx(curve.radius, rel=0.05)
        assert np.linalg.norm(path.acceleration(t), axis=1).max() == pytest.approx(curve.acceleration, rel=0.1)
    for m, poses in zip(FOUR, (h.placed(i) for i in range(4)), strict=True):
        np.testing.assert_allclose(poses[:, 7:], m.poses[:, 7:], atol=1e-12)


def test_same_seed_gives_the_same_curves():
    lifted = four_lifted()
    again = lifted_at(FOUR)
    np.testing.assert_array_equal(again.sites, lifted.sites)
    for a, b in zip(again.angles, lifted.angles, strict=True):
        np.testing.assert_array_equal(a, b)


def test_acceleration_limit_keeps_fast_clips_where_the_device_can_follow():
    # The fast clip lies between the other two; at the innermost radius its acceleration is 0.58 of that there.
    three = [motion(swinging(1, amplitude=a), f"{a}", fps=fps) for a, fps in ((0.2, 30.0), (0.4, 150.0), (0.6, 30.0))]
    wide = (0.02, 0.072)
    unlimited = lifted_at(three, Room(wide, acceleration=100.0)).after.curves[1].acceleration
    limited = lifted_at(three, Room(wide, acceleration=0.8 * unlimited)).after.curves[1].acceleration
    assert 0.7 * unlimited < limited <= 0.8 * unlimited


def test_slow_and_fast_curves_are_level():
    # Two motions that are alike twice a lap.
    lap = 0.05 + 0.03 * np.cos(2.0 * np.linspace(0.0, 2.0 * np.pi, N_ANGLES, endpoint=False))
    distance = lap[:, None, None] * (1.0 - np.eye(2))
    bends, paces = list[float](), list[float]()
    for rate in (0.5, 2.0, 4.0, 9.0):
        still = np.zeros((N_ANGLES, 2))
        task = Task(ROOM.rectangle, 0.01, 0.002, 10.0, 100.0, distance, [], still + rate, still)
        controls = arrange(task, np.random.default_rng(0))[0]
        bends.append(np.ptp(controls, axis=0).max())
        sites, slopes, _ = evaluate_sites(controls)
        # Of a push across the curves with 2.5 N, against 8 N s/m, relative to the speed θ̇ r of a level curve.
        along = 2.5 / 8.0 * np.linalg.norm(slopes, axis=2) / sites[..., 0]
        paces.append((along / (rate * sites[..., 0])).max())
    slow, middle, faster, fast = bends
    assert middle > 3e-3
    assert faster < 0.5 * middle
    assert max(slow, fast) < 0.1 * middle
    assert paces[0] < 0.02 < 0.2 < paces[1]


@pytest.mark.slow
def test_twelve_clips_keep_their_separation():
    many = [motion(swinging(k, amplitude=0.2 + 0.05 * k), f"{k}") for k in range(12)]
    found = lifted_at(many)
    assert found.after.separation >= ROOM.separation


def test_lattice_is_dense_and_respects_the_separation():
    rectangle = Rectangle(0.02, 0.072, -0.05, 0.05)
    for separation in (0.004, 0.01, 0.03):
        points = lattice(rectangle, separation)
        apart = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(len(points))
        assert apart.min() >= separation * (1.0 - 1e-9)
        assert (points >= rectangle.low - 1e-12).all()
        assert (points <= rectangle.high + 1e-12).all()
        # Compared with a square lattice.
        assert len(points) >= (int(0.052 / separation) + 1) * (int(0.1 / separation) + 1) * 0.9


# Special cases and invalid arguments.


def test_clips_of_any_length_and_rate_are_lifted():
    clips = [motion(swinging(1, frames=40), "short", 25.0), motion(swinging(2, frames=500), "long", 120.0)]
    found = lifted_at(clips)
    h = Lifted([(m.poses, m.fps) for m in clips], [True, True], found.angles, found.sites)
    assert h.curve(0).duration == pytest.approx(40 / 25)
    assert h.curve(1).duration == pytest.approx(500 / 120)
    assert found.after.separation >= ROOM.separation


def test_duplicate_clips_are_reported_and_kept_apart():
    found = lifted_at([FOUR[0], motion(FOUR[0].poses, "again"), FOUR[1]])
    assert found.same == ((0, 1),)
    assert all({t.first, t.second} != {0, 1} for t in found.transitions)
    assert found.after.separation >= ROOM.separation


def test_still_clip_is_reported_and_has_a_curve():
    found = lifted_at([FOUR[0], motion(np.tile(FOUR[1].poses[:1], (31, 1)), "still")])
    assert found.still == (1,)
    assert np.isfinite(found.sites).all()
    assert found.after.separation >= ROOM.separation


def test_single_clip_has_a_curve():
    found = lifted_at(FOUR[:1])
    assert found.after.separation == np.inf
    assert found.transitions == ()


def cut_short():
    return swinging(3)[:80]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: lifted_at([]), "no clips to lift"),
        (lambda: lifted_at([motion(swinging(1)[:1], "one")]), "clip 'one': a clip needs at least 2 frames, got 1"),
        (lambda: lifted_at([motion(swinging(1)[:3], "few", closed=False)]), "'few' has 3 frames, and a curve needs 4"),
        (lambda: lifted_at([motion(cut_short(), "cut")]), "'cut' is given as cyclic.*lift it as an open"),
        (lambda: lifted_at([FOUR[0], FOUR[1]], Room(separation=0.2)), "2 clips do not fit 200 mm apart .* 1 do"),
        (lambda: lifted_at([FOUR[0]] * 120, Room(separation=0.008)), r"120 clips do not fit.*separation of \d\.\d mm"),
        (lambda: lifted_at([motion(swinging(1), "fast", fps=3000.0)]), "'fast' goes round in 0.04 s.*slow it down to"),
        (lambda: lift([FOUR[0]], WEIGHTS[:2], ROOM, np.random.default_rng(0)), "4 rotations, there are 2 weights"),
        (lambda: Room(approach=0.02), "approach at transitions is 20 mm, more than the separation"),
        (lambda: Room(r_range=(0.05, 0.02)), "r_range must increase"),
        (lambda: Room(separation=np.nan), "separation"),
        (lambda: motion(swinging(1), supports=np.ones((3, 2), bool)), "supports have shape"),
    ],
)  # fmt: skip
def test_impossible_lifts_raise_parameter_error_with_a_remedy(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


def test_is_apart_detects_curves_that_come_too_close():
    """The check on which `arrange` relies."""
    task = Task(
        Rectangle(0.02, 0.07, -0.05, 0.05), 0.01, 0.002, 1.0, 8.0, np.ones((N_ANGLES, 2, 2)), [],
        np.ones((N_ANGLES, 2)), np.zeros((N_ANGLES, 2)),
    )  # fmt: skip
    controls = np.tile(np.array([[0.03, 0.0], [0.05, 0.0]]), (N_ROWS, 1, 1))
    assert is_apart(task, controls)
    controls[10:20, 1, 0] = 0.035
    assert not is_apart(task, controls)
    assert evaluate_sites(controls)[0].shape == (N_ANGLES, 2, 2)
