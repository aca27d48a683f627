"""Region of attraction: interval bounds, decrease of Lyapunov forms over cells, and the verdicts."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from controllers.certificates.loop.device import kinematics_function, plant_function
from controllers.certificates.loop.hand import NO_HANDS, HandRange
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW, follow_law
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.region.decrease_check import check_form
from controllers.certificates.region.intervals import bounds, spectral_bound
from controllers.certificates.region.lyapunov import Axis, Cell, Limits, decrease, find_form
from controllers.certificates.region.region import region
from controllers.certificates.region.tube_bounds import tube_bounds
from controllers.certificates.report import CertificateError, Verdict
from controllers.curves.trajectory import Trajectory
from experiments.certify.certified_device import phantom_device
from tests.derivatives import central_differences

SLOW = Trajectory.circle(0.0477, 12.0)
RIVER = CertifiedRiver(FOLLOW_LAW, 300.0, 8.0, 0.25, SLOW, phantom_device(), Sampling(1e-3))
AXIS = Axis(300.0, 8.0, 1e-3, RIVER.sampling.keep, 0, True)
STABLE = Verdict("certified", "")


def test_interval_bounds_contain_sampled_values():
    x = ca.SX.sym("x", 2)
    entries = [ca.sin(x[0]) * x[1], 1 / x[1], x[0] ** 2 - ca.cos(3 * x[0]), ca.sqrt(x[1]) - 2 * x[0]]
    function = ca.Function("f", [x], [ca.reshape(ca.vertcat(*entries), 2, 2)])
    rng = np.random.default_rng(1)
    low = rng.uniform([-4.0, 0.5], [4.0, 2.0], (60, 2))
    high = low + rng.uniform(0.0, 1.5, (60, 2))
    least, most = bounds(function, low, high)
    for i in range(60):
        for point in rng.uniform(low[i], high[i], (40, 2)):
            value = np.array(function(point))
            assert np.all(least[i] <= value)
            assert np.all(value <= most[i])
            assert np.linalg.norm(value, 2) <= spectral_bound(least[i : i + 1], most[i : i + 1])[0]
    with pytest.raises(CertificateError, match="holds zero"):
        bounds(function, np.array([[0.0, -1.0]]), np.array([[1.0, 1.0]]))


@pytest.mark.parametrize("z", [(0.03, 8.0, 500.0, 0.9), (0.3, 0.0, 0.0, 1.0)])
def test_axis_matrix_matches_sampled_mass_on_a_spring(z):
    mass, drag, spring, share = z
    plant = np.zeros((3, 3))
    plant[0, 1], plant[1] = 1.0, [-spring / mass, -drag / mass, 1.0 / mass]
    step = expm(plant * AXIS.period)
    feedback = np.array([-share * 300.0, 0.0, -share * 8.0])
    after = np.vstack([np.append(step[i, :2], 0.0) + step[i, 2] * feedback for i in range(2)])
    filtered = (1.0 - AXIS.keep) / AXIS.period * (after[0] - np.eye(3)[0]) + AXIS.keep * np.eye(3)[2]
    found = AXIS.numbers(z) * AXIS.scale[:, None] / AXIS.scale
    np.testing.assert_allclose(found, np.vstack([after, filtered]), rtol=1e-10, atol=1e-12)


@pytest.mark.slow
def test_form_decreases_at_random_points_of_checked_cells():
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
    # A form required to decrease faster than the slowest axis fails the same check.
    assert check_form(AXIS, form._replace(rate=60.0), cell, (30, 4, 2, 1)).least < 0.0


def motion_in_a_period(mass, drag, ends):
    """e, ν and y of a mass with drag after one period of a force that is constant in each half of it."""
    plant = np.zeros((3, 3))
    plant[0, 1], plant[1] = 1.0, [0.0, -drag / mass, 1.0 / mass]
    half, e, v = expm(plant * 0.5 * AXIS.period), 0.0, 0.0
    for force in ends:
        e, v = half[0, 0] * e + half[0, 1] * v + half[0, 2] * force, half[1, 1] * v + half[1, 2] * force
    return np.array([e, v, (1.0 - AXIS.keep) / AXIS.period * e]) / AXIS.scale


@pytest.mark.parametrize("drag", [6.0, pytest.param(0.0, marks=pytest.mark.slow)])
def test_projection_and_disturbances_cost_no_more_than_the_allowance(drag):
    extra_mass = 0.06 if drag else 0.0
    cell = Cell(
        np.array([0.03 + extra_mass, drag, 0.0, 1.0]), np.array([0.15 + extra_mass, drag, 0.0, 1.0]), 0.15, 0.03
    )
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
        # A force in newtons and one in the metric, of these sizes, each with another direction in each half period.
        sizes = rng.uniform(0.0, 1.0, 2)
        forces = rng.normal(size=(2, 2, 3))
        forces *= sizes[:, None, None] / np.linalg.norm(forces, axis=2, keepdims=True)
        metric = np.sqrt(masses - extra_mass)
        disturbance = np.stack(
            [motion_in_a_period(masses[i], drag, forces[0, :, i] + metric[i] * forces[1, :, i]) for i in range(3)],
            axis=1,
        )
        maps = [AXIS.numbers((mass, drag, 0.0, 1.0)) for mass in masses]
        forms = [form.numbers((mass, drag, 0.0, 1.0)) for mass in masses]
        after = np.stack([a @ x[:, i] for i, a in enumerate(maps)], axis=1) + disturbance
        after[0] -= along * (along @ after[0])
        before, later = (sum(z[:, i] @ p @ z[:, i] for i, p in enumerate(forms)) for z in (x, after))
        allowed = fall * before + AXIS.period * gains @ sizes**2
        assert later <= allowed * (1.0 + 1e-9)
        tightest = max(tightest, later / allowed)
    assert tightest > 0.9


def test_tube_bounds_hold_at_sampled_points():
    device, radius = RIVER.device, 0.006
    tube = tube_bounds(device, SLOW, radius)
    kinematics, plant, still = kinematics_function(device), plant_function(device), np.zeros(3)

    def inertia(p):
        theta = np.array(device.angles(p))
        back = np.linalg.inv(np.array(kinematics(theta, 0.0)[0]))
        return back.T @ np.array(plant(theta, still, still, still, still, still)[0]) @ back

    rng = np.random.default_rng(4)
    for _ in range(60):
        away, direction = rng.normal(size=(2, 3))
        p = SLOW.point(rng.uniform(0.0, 12.0)) + 0.999 * radius * away / np.linalg.norm(away)
        direction /= np.linalg.norm(direction)
        here = inertia(p)
        values = np.linalg.eigvalsh(here)
        assert tube.mass_low <= values[0]
        assert values[-1] <= tube.mass_high
        root = np.linalg.inv(np.linalg.cholesky(here))
        change = (
            root
            @ central_differences(lambda h, p=p, direction=direction: inertia(p + h * direction), 0.0, 1e-6)
            @ root.T
        )
        assert np.linalg.norm(change, 2) <= tube.mass_slope


FIRM_HANDS = HandRange((0.25, 0.3), (6.0, 8.0), (0.0, 0.0))


@cache
def firm_region(lap, law=FOLLOW_LAW):
    return region(RIVER._replace(curve=Trajectory.circle(0.0477, lap), law=law), FIRM_HANDS, 8.5, STABLE)


@pytest.mark.slow
@pytest.mark.parametrize("lap", [4.0, 12.0])
def test_demo_river_in_a_firm_hand_has_a_certified_region(lap):
    good = firm_region(lap)
    assert good.verdict == "certified"
    assert 4e-3 < good.margin < 6e-3
    assert good.figures["ball"] < 2e-3 < good.figures["largest_distance"] <= 6e-3
    assert good.figures["cell_least"] > 0.0
    assert good.figures["remainder_rate"] < good.figures["rate"]


@pytest.mark.slow
def test_parallel_gate_has_a_larger_force_remainder():
    good, parallel = firm_region(4.0), firm_region(4.0, follow_law(1.0))
    assert parallel.verdict == "certified"
    assert good.figures["remainder_force"] < parallel.figures["remainder_force"]


@pytest.mark.slow
def test_unknown_region_names_the_hand_that_exceeds_the_bounds():
    bare = region(RIVER, NO_HANDS, 8.5, STABLE)
    assert bare.verdict == "unknown"
    assert "hands of 0 kg, 0 N s/m, 0 N/m alone" in bare.reason
    assert "no region is certified" in bare.reason
    assert region(RIVER._replace(law=BUNNY_LAW), FIRM_HANDS, 8.5, STABLE).verdict == "unknown"
    assert region(RIVER._replace(sampling=Sampling(1e-3, 5e-4)), FIRM_HANDS, 8.5, STABLE).verdict == "unknown"
    assert "too much for its bends" in region(RIVER._replace(width=0.007), FIRM_HANDS, 8.5, STABLE).reason
    unstable = Verdict("refuted", "", -0.5, (), {"state": [1.0]})
    assert region(RIVER, FIRM_HANDS, 8.5, unstable).counterexample == {"state": [1.0]}


@pytest.mark.slow
def test_region_for_all_hands_reports_the_firm_part():
    found = region(RIVER._replace(curve=Trajectory.circle(0.0477, 4.0)), HandRange(), 8.5, STABLE)
    assert found.verdict == "unknown"
    assert "with hands of 0.3 kg, 0 N s/m" in found.reason
    assert found.figures["firm_hands"] == HandRange((0.24, 0.3), (6.4, 8.0), (0.0, 100.0))
    assert found.figures["ball"] < found.figures["distance"] < 6e-3
