import numpy as np
import pytest

from models.humanoid.skeleton import N_TANGENT
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.preparation import feasible, motion_errors
from models.mocap.preparation.change import DEGREE, Change, NormalEquations
from models.mocap.preparation.feasible import _Problem
from models.mocap.preparation.motion_errors import MotionErrors
from models.mocap.preparation.poses import add_tangents, resampled, smoothed
from models.mocap.preparation.stances import stances


@pytest.fixture(scope="module", params=["closed", "open", "passage"])
def change(request):
    walk = resampled(embedded("walk"), 60.0)
    clip = walk if request.param == "closed" else Clip(walk.poses[:40], 60.0, "part")
    return Change(clip, 0.1 if request.param != "passage" else 0.05, 0.05 if request.param != "passage" else 0.025,
                  request.param == "passage")  # fmt: skip


def test_pose_difference_inverts_plus():
    rng = np.random.default_rng(0)
    poses = embedded("ginga").poses[:5]
    tangents = 0.3 * rng.normal(size=(5, N_TANGENT))
    np.testing.assert_allclose(pose_difference(poses, add_tangents(poses, tangents)), tangents, atol=1e-12)


def test_zero_change_leaves_the_motion_unchanged(change):
    same = change.changed(np.zeros((change.n_points, N_TANGENT)), 60.0)
    frames = min(same.n_frames, change.clip.n_frames)
    np.testing.assert_allclose(pose_difference(same.poses[:frames], change.clip.poses[:frames]), 0.0, atol=2e-3)
    assert same.closes() == change.clip.closes()


def test_changed_lap_still_closes(change):
    x = 0.02 * np.random.default_rng(1).normal(size=(change.n_points, N_TANGENT))
    assert change.changed(x, 60.0).closes() == change.closed


def test_changed_open_motion_still_rests_at_its_ends(change):
    if change.closed:
        pytest.skip("a lap has no ends")
    x = 0.02 * np.random.default_rng(1).normal(size=(change.n_points, N_TANGENT))
    for order in (1, 2):
        rates = np.einsum("mk,mkn->mn", change.basis[order], change.points(x)[change.first[:, None] + np.arange(6)])
        np.testing.assert_allclose(rates[[0, -1]], 0.0, atol=1e-6)
        assert np.abs(rates).max() > 0.05


def test_change_of_a_passage_vanishes_to_second_order_at_its_ends():
    """Value, velocity and acceleration of the change are zero at the ends; the velocity of the motion is kept."""
    walk = resampled(embedded("walk"), 60.0)
    clip = Clip(walk.poses[:60], 60.0, "part")
    change = Change(clip, 0.05, 0.0125, passage=True)
    x = 0.02 * np.random.default_rng(1).normal(size=(change.n_points, N_TANGENT))
    for order in (0, 1, 2):
        values = np.einsum("mk,mkn->mn", change.basis[order], change.points(x)[change.first[:, None] + np.arange(6)])
        np.testing.assert_allclose(values[[0, -1]], 0.0, atol=1e-6)
        assert np.abs(values).max() > 0.02
    state = change.states(x)
    step = pose_difference(clip.poses[:1], clip.poses[1:2])[0] * clip.fps
    assert np.linalg.norm(state.v[0, :3]) == pytest.approx(np.linalg.norm(step[:3]), rel=0.1)
    assert np.linalg.norm(step[:3]) > 0.5
    changed = change.changed(x, 60.0)
    for end in (0, -1):
        np.testing.assert_allclose(changed.poses[end], clip.poses[end], atol=1e-12)


def test_normal_equations_by_chunks_equal_those_of_all_intervals_at_once(change, monkeypatch):
    """Chunks of knot intervals, so that memory need not hold all Jacobians, give the same normal equations."""
    problem = _Problem(change, MotionErrors(change, stances(change.clip, change.clip)))
    x = 1e-3 * np.random.default_rng(4).normal(size=change.n_points * N_TANGENT)
    whole, g = problem._linearise(x)
    monkeypatch.setattr(feasible, "_CHUNK", 3)
    parts, h = problem._linearise(x)
    np.testing.assert_allclose(parts.band, whole.band, atol=1e-9 * np.abs(whole.band).max())
    np.testing.assert_allclose(h, g, atol=1e-9 * np.abs(g).max())


def test_banded_normal_equations_match_the_stacked_rows(change):
    """The banded and bordered matrix against products with the residual rows, one for each knot interval."""
    rng = np.random.default_rng(2)
    rows = [rng.normal(size=(2, (DEGREE + 1) * N_TANGENT)) for _ in range(change.intervals)]
    normal, n = NormalEquations(change), change.n_points * N_TANGENT
    for interval, row in enumerate(rows):
        normal.add(interval, row.T @ row)
    normal.band[0] += 1.0
    normal.corner += np.eye(len(normal.corner))

    def stacked(x):
        points = change.points(x.reshape(-1, N_TANGENT))
        return np.concatenate([row @ points[k : k + DEGREE + 1].ravel() for k, row in enumerate(rows)])

    sample = rng.normal(size=n)
    residual = np.concatenate([row @ np.ones((DEGREE + 1) * N_TANGENT) for row in rows])
    gradient = normal.gradient(np.array([rows[k].T @ residual[2 * k : 2 * k + 2] for k in range(change.intervals)]))
    assert stacked(sample) @ residual == pytest.approx(sample @ gradient)
    assert sample @ normal.times(sample) == pytest.approx(stacked(sample) @ stacked(sample) + sample @ sample)
    expected = rng.normal(size=n)
    np.testing.assert_allclose(normal.times(normal.solve(expected, 0.0)), expected, atol=1e-5)


def test_error_jacobian_matches_central_differences(change, monkeypatch):
    """Differences along random changes; the step is so small that contacts keep their active edges."""
    monkeypatch.setattr(
        motion_errors, "_STRAIN_THRESHOLD", 0.02
    )  # so low that most torques contribute, also those of standing legs
    clip = change.clip
    problem = MotionErrors(change, stances(clip, smoothed(clip)))
    # Narrow ranges, so that bent joints exceed them about all axes, where rotation vectors change nonlinearly.
    problem.low, problem.high = 0.05 * problem.low, 0.05 * problem.high
    rng = np.random.default_rng(3)
    x = 1e-3 * rng.normal(size=change.n_points * N_TANGENT)
    errors = problem.at(x, True)
    direction = rng.normal(size=x.shape)
    which = change.first[:, None] + np.arange(DEGREE + 1)
    points = change.points(direction.reshape(-1, N_TANGENT))
    parts = np.stack([np.einsum("mk,mkn->mn", change.basis[order], points[which]) for order in range(3)], axis=1)
    analytic = np.einsum("mofn,mon->mf", errors.jacobian, parts)
    step = 1e-6
    ahead, behind = (problem.at(x + sign * step * direction, False).weighted for sign in (1, -1))
    numeric = (ahead - behind) / (2 * step)
    # The two ends of an open motion take the velocities of their neighbours.
    inner = slice(1, -1) if not (change.closed or change.passage) else slice(None)
    scale = np.abs(numeric[inner]).max(axis=0) + 1.0
    assert np.quantile(np.abs(analytic - numeric)[inner] / scale, 0.99) < 0.02
