import casadi
import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from models.phantom import dynamics
from models.phantom.parameters import PREMIUM_1_5


def _acceleration(theta, theta_dot):
    coriolis = np.array(dynamics.coriolis_matrix(theta, theta_dot)) @ theta_dot
    return np.linalg.solve(dynamics.mass_matrix(theta), -coriolis - dynamics.gravity_torques(theta))


def _free_swing(theta, theta_dot, duration, **options):
    return solve_ivp(
        lambda _, state: np.r_[state[3:], _acceleration(state[:3], state[3:])],
        (0.0, duration), np.r_[theta, theta_dot], method="DOP853", rtol=1e-12, atol=1e-13, **options,
    )  # fmt: skip


def test_mass_matrix_at_zero_matches_published_values():
    assert np.diag(dynamics.mass_matrix(np.zeros(3))) == pytest.approx([3.573e-3, 2.426e-3, 0.932e-3], abs=5e-7)


def test_inertia_and_gravity_agree_with_the_compiled_linkage(linkage, configurations):
    full = np.zeros((linkage.model.nv, linkage.model.nv))
    for theta in configurations:
        data = linkage.place(theta)
        mujoco.mj_fullM(linkage.model, data, full)
        mass, gravity = np.array(dynamics.mass_matrix(theta)), np.array(dynamics.gravity_torques(theta))
        assert np.abs(linkage.closure.T @ full @ linkage.closure - mass).max() < 1e-9 * np.abs(mass).max()
        assert np.abs(linkage.closure.T @ data.qfrc_bias - gravity).max() < 1e-9 * np.abs(gravity).max()


def test_bias_torques_agree_with_the_compiled_linkage(linkage, configurations):
    rng = np.random.default_rng(1)
    for theta in configurations:
        theta_dot = rng.normal(scale=3.0, size=3)
        data = linkage.place(theta, theta_dot)
        bias = np.array(dynamics.coriolis_matrix(theta, theta_dot)) @ theta_dot + dynamics.gravity_torques(theta)
        assert np.abs(linkage.closure.T @ data.qfrc_bias - bias).max() < 1e-9 * np.abs(bias).max()


def test_mass_matrix_is_positive_definite(configurations):
    for theta in configurations:
        assert np.linalg.eigvalsh(dynamics.mass_matrix(theta)).min() > 5e-4


def test_mass_rate_minus_twice_coriolis_is_skew_symmetric(configurations):
    rng = np.random.default_rng(2)
    step = 1e-5
    for theta in configurations[:200]:
        theta_dot = rng.normal(size=3)
        ahead, behind = (dynamics.mass_matrix(theta + side * step * theta_dot) for side in (1, -1))
        rate = np.subtract(ahead, behind) / (2 * step)
        skew = rate - 2.0 * np.array(dynamics.coriolis_matrix(theta, theta_dot))
        assert np.abs(skew + skew.T).max() < 1e-11


def test_free_swing_conserves_the_energy_computed_by_mujoco(linkage):
    linkage.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    solution = _free_swing([0.2, 0.3, 0.4], [2.0, -1.5, 1.0], 1.0, t_eval=np.linspace(0.0, 1.0, 101))
    energy = []
    for state in solution.y.T:
        data = linkage.place(state[:3], state[3:])
        energy.append(data.energy.sum())
    kinetic = [0.5 * s[3:] @ np.array(dynamics.mass_matrix(s[:3])) @ s[3:] for s in solution.y.T]
    assert np.ptp(kinetic) > 0.05, "the swing exchanges energy"
    assert np.ptp(energy) < 1e-9


def test_free_swing_of_the_linkage_converges_linearly_to_the_closed_form(linkage):
    start, rate, duration = np.array([0.2, 0.3, 0.4]), np.array([2.0, -1.5, 1.0]), 0.5
    linkage.model.dof_damping[:] = 0.0
    linkage.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS | mujoco.mjtDisableBit.mjDSBL_LIMIT
    expected = _free_swing(start, rate, duration).y[:3, -1]
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        linkage.model.opt.timestep = step
        mujoco.mj_resetData(linkage.model, linkage.data)
        linkage.place(start, rate)
        for _ in range(round(duration / step)):
            mujoco.mj_step(linkage.model, linkage.data)
        errors.append(np.abs(linkage.theta() - expected).max())
    assert np.abs(expected - start).max() > 1.0, "it swings"
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    assert order == pytest.approx(1.0, abs=0.1)
    assert errors[-1] < 2e-3


def test_apparent_mass_at_the_tip_matches_the_data_sheet():
    across, up, _ = np.diag(dynamics.mass_matrix(np.zeros(3))) / PREMIUM_1_5.l1**2
    assert 0.04 < up < across < 0.08  # "inertia at tip < 75 g"


@pytest.mark.parametrize("name", ["mass_matrix", "coriolis_matrix", "gravity_torques"])
def test_symbolic_dynamics_match_the_compiled_kernels(name, configurations):
    casadi.GlobalOptions.setNumpyMode(1)
    theta, theta_dot = casadi.SX.sym("theta", 3), casadi.SX.sym("theta_dot", 3)
    kernel = getattr(dynamics, name)
    symbols = (theta, theta_dot) if name == "coriolis_matrix" else (theta,)
    rows = kernel.py_func(*symbols)
    entries = [entry for row in rows for entry in (row if isinstance(row, tuple) else (row,))]
    function = casadi.Function(name, list(symbols), [casadi.vertcat(*map(casadi.SX, entries))])
    rng = np.random.default_rng(3)
    for sample in configurations[:50]:
        values = (sample, rng.normal(size=3))[: len(symbols)]
        assert np.allclose(np.array(function(*values)).ravel(), np.ravel(kernel(*values)), rtol=1e-12, atol=1e-16)
