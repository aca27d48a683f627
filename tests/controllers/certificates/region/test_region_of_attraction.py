"""Bounds hold what they bound, a form's cells are no weaker than its points, and the region says what it knows."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from controllers.certificates.loop.device import kinematics_function, plant_function
from controllers.certificates.loop.hand import NO_HANDS, HandRange
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW, PARALLEL_LAW
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import River
from controllers.certificates.region.decrease_check import check_form
from controllers.certificates.region.intervals import bounds, spectral_bound
from controllers.certificates.region.lyapunov import Axis, Cell, Limits, decrease, find_form
from controllers.certificates.region.region import region
from controllers.certificates.region.tube_bounds import tube_bounds
from controllers.certificates.report import CertificateError, Verdict
from controllers.curves.trajectory import Trajectory
from experiments.certify.certified_device import phantom_device

SLOW = Trajectory.circle(0.0477, 12.0)
RIVER = River(FOLLOW_LAW, 300.0, 8.0, 0.25, SLOW, phantom_device(), Sampling(1e-3))
AXIS = Axis(300.0, 8.0, 1e-3, RIVER.sampling.keep, 0, True)
STABLE = Verdict("certified", "")


def test_no_value_leaves_its_interval():
    x = ca.SX.sym("x", 2)
    entries = [ca.sin(x[0]) * x[1], 1 / x[1], x[0] ** 2 - ca.cos(3 * x[0]), ca.sqrt(x[1]) - 2 * x[0]]
    function = ca.Function("f", [x], [ca.reshape(ca.vertcat(*entries), 2, 2)])
    rng = np.random.default_rng(1)
    low = rng.uniform([-4.0, 0.5], [4.0, 2.0], (60, 2))
    high = low + rng.uniform(0.0, 1.5, (60, 2))
    least, most = bounds(function, low, high)
    for i in range(60):
        for place in rng.uniform(low[i], high[i], (40, 2)):
            value = np.array(function(place))
            assert np.all(least[i] <= value)
            assert np.all(value <= most[i])
            assert np.linalg.norm(value, 2) <= spectral_bound(least[i : i + 1], most[i : i + 1])[0]
    with pytest.raises(CertificateError, match="holds zero"):
        bounds(function, np.array([[0.0, -1.0]]), np.array([[1.0, 1.0]]))


@pytest.mark.parametrize("z", [(0.03, 8.0, 500.0, 0.9), (0.3, 0.0, 0.0, 1.0)])
def test_an_axis_is_the_sampled_mass_on_its_spring(z):
    mass, drag, spring, share = z
    plant = np.zeros((3, 3))
    plant[0, 1], plant[1] = 1.0, [-spring / mass, -drag / mass, 1.0 / mass]
    step = expm(plant * AXIS.period)
    felt = np.array([-share * 300.0, 0.0, -share * 8.0])
    after = np.vstack([np.append(step[i, :2], 0.0) + step[i, 2] * felt for i in range(2)])
    filtered = (1.0 - AXIS.keep) / AXIS.period * (after[0] - np.eye(3)[0]) + AXIS.keep * np.eye(3)[2]
    found = AXIS.numbers(z) * AXIS.scale[:, None] / AXIS.scale
    np.testing.assert_allclose(found, np.vstack([after, filtered]), rtol=1e-10, atol=1e-12)


@pytest.mark.slow
def test_a_form_decreases_between_the_corners_where_its_cells_say_so():
    cell = Cell(np.array([0.15, 2.0, 0.0, 0.99]), np.array([0.3, 4.0, 100.0, 1.0]), 0.15, 0.03)
    form = find_form(AXIS, cell, Limits(5.5, 0.01, 0.5, (0.15, 0.1)), 6.0)
    assert form is not None
    slower = form._replace(rate=5.5, gains=tuple(1.1 * gain for gain in form.gains))
    checked = check_form(AXIS, slower, cell, (50, 4, 2, 1))
    assert checked.least > 0.0
    rng = np.random.default_rng(2)
    for z in rng.uniform(cell.low, cell.high, (300, 4)):
        a = AXIS.numbers(z).tolist()
        for early in (True, False):
            pushes = AXIS.pushes(a, z[0], cell.lever(z[0]), slower.units, early)
            rows = decrease(AXIS, a, pushes, slower.numbers(z).tolist(), slower)
            assert np.linalg.eigvalsh(np.array(rows, dtype=float))[0] >= checked.least
    # One that is asked to fall faster than the slowest axis by itself fails the same check.
    assert check_form(AXIS, form._replace(rate=60.0), cell, (30, 4, 2, 1)).least < 0.0


def motion_in_a_period(mass, drag, ends):
    """e, ν and y's part of a mass with drag after a period of a force that is one value in each half of it."""
    plant = np.zeros((3, 3))
    plant[0, 1], plant[1] = 1.0, [0.0, -drag / mass, 1.0 / mass]
    half, e, v = expm(plant * 0.5 * AXIS.period), 0.0, 0.0
    for force in ends:
        e, v = half[0, 0] * e + half[0, 1] * v + half[0, 2] * force, half[1, 1] * v + half[1, 2] * force
    return np.array([e, v, (1.0 - AXIS.keep) / AXIS.period * e]) / AXIS.scale


@pytest.mark.parametrize("drag", [6.0, pytest.param(0.0, marks=pytest.mark.slow)])
def test_what_the_nearest_point_takes_away_and_forces_that_change_cost_no_more_than_is_allowed_for(drag):
    heavy = 0.06 if drag else 0.0
    cell = Cell(np.array([0.03 + heavy, drag, 0.0, 1.0]), np.array([0.15 + heavy, drag, 0.0, 1.0]), 0.15, 0.03)
    form = find_form(AXIS, cell, Limits(5.5, 0.01, 0.5, (0.2, 0.3)), 10.0)
    assert form is not None
    rng = np.random.default_rng(3)
    fall = np.exp(-2.0 * 10.0 * AXIS.period)
    gains = np.array(form.gains) / np.array(form.units) ** 2
    tightest = 0.0
    for _ in range(100):
        masses = np.exp(rng.uniform(np.log(cell.low[0]), np.log(cell.high[0]), 3))
        along = rng.normal(size=3)
        along /= np.linalg.norm(along)
        x = rng.normal(size=(3, 3)) * rng.uniform(0.0, 0.3)
        x[0] -= along * (along @ x[0])
        # A force in newtons and one in the metric, of these sizes, of another direction in each half of the period.
        sizes = rng.uniform(0.0, 1.0, 2)
        ways = rng.normal(size=(2, 2, 3))
        ways *= sizes[:, None, None] / np.linalg.norm(ways, axis=2, keepdims=True)
        own = np.sqrt(masses - heavy)
        pushed = np.stack(
            [motion_in_a_period(masses[i], drag, ways[0, :, i] + own[i] * ways[1, :, i]) for i in range(3)], axis=1
        )
        maps = [AXIS.numbers((mass, drag, 0.0, 1.0)) for mass in masses]
        forms = [form.numbers((mass, drag, 0.0, 1.0)) for mass in masses]
        after = np.stack([a @ x[:, i] for i, a in enumerate(maps)], axis=1) + pushed
        after[0] -= along * (along @ after[0])
        before, later = (sum(z[:, i] @ p @ z[:, i] for i, p in enumerate(forms)) for z in (x, after))
        allowed = fall * before + AXIS.period * gains @ sizes**2
        assert later <= allowed * (1.0 + 1e-9)
        tightest = max(tightest, later / allowed)
    assert tightest > 0.9


def test_the_tubes_bounds_hold_at_its_points():
    device, radius = RIVER.device, 0.006
    tube = tube_bounds(device, SLOW, radius)
    kinematics, plant, still = kinematics_function(device), plant_function(device), np.zeros(3)

    def inertia(p):
        theta = np.array(device.angles(p))
        back = np.linalg.inv(np.array(kinematics(theta, 0.0)[0]))
        return back.T @ np.array(plant(theta, still, still, still, still, still)[0]) @ back

    rng = np.random.default_rng(4)
    for _ in range(60):
        away, way = rng.normal(size=(2, 3))
        p = SLOW.point(rng.uniform(0.0, 12.0)) + 0.999 * radius * away / np.linalg.norm(away)
        way *= 1e-6 / np.linalg.norm(way)
        here = inertia(p)
        values = np.linalg.eigvalsh(here)
        assert tube.mass_low <= values[0]
        assert values[-1] <= tube.mass_high
        root = np.linalg.inv(np.linalg.cholesky(here))
        change = root @ (inertia(p + way) - inertia(p - way)) @ root.T / 2e-6
        assert np.linalg.norm(change, 2) <= tube.mass_slope


FIRM = HandRange((0.25, 0.3), (6.0, 8.0), (0.0, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("lap", [4.0, 12.0])
def test_the_demos_river_in_a_firm_hand_has_a_region(lap):
    good = region(RIVER._replace(curve=Trajectory.circle(0.0477, lap)), FIRM, 8.5, STABLE)
    assert good.verdict == "certified"
    assert 4e-3 < good.margin < 6e-3
    assert good.figures["ball"] < 2e-3 < good.figures["largest_distance"] <= 6e-3
    assert good.figures["cell_least"] > 0.0
    assert good.figures["remainder_rate"] < good.figures["rate"]
    beside = region(RIVER._replace(curve=Trajectory.circle(0.0477, lap), law=PARALLEL_LAW), FIRM, 8.5, STABLE)
    assert beside.verdict == "certified"
    assert good.figures["remainder_force"] < beside.figures["remainder_force"]


@pytest.mark.slow
def test_what_is_too_much_to_be_certain_is_told_with_the_hand_it_is_of():
    bare = region(RIVER, NO_HANDS, 8.5, STABLE)
    assert bare.verdict == "unknown"
    assert "hands of 0 kg, 0 N s/m, 0 N/m alone" in bare.reason
    assert "too much to be certain" in bare.reason
    assert region(RIVER._replace(law=BUNNY_LAW), FIRM, 8.5, STABLE).verdict == "unknown"
    assert region(RIVER._replace(sampling=Sampling(1e-3, 5e-4)), FIRM, 8.5, STABLE).verdict == "unknown"
    assert "too much for its bends" in region(RIVER._replace(width=0.007), FIRM, 8.5, STABLE).reason
    unstable = Verdict("refuted", "", -0.5, (), {"state": [1.0]})
    assert region(RIVER, FIRM, 8.5, unstable).counterexample == {"state": [1.0]}


@pytest.mark.slow
def test_of_any_hands_the_firm_part_is_certain():
    found = region(RIVER._replace(curve=Trajectory.circle(0.0477, 4.0)), HandRange(), 8.5, STABLE)
    assert found.verdict == "unknown"
    assert "with hands of 0.3 kg, 0 N s/m" in found.reason
    assert found.figures["firm_hands"] == HandRange((0.24, 0.3), (6.4, 8.0), (0.0, 100.0))
    assert found.figures["ball"] < found.figures["distance"] < 6e-3
