r"""Dynamics of the Phantom in closed form: compiled functions; their ``.py_func`` also takes CasADi symbols.

.. math:: M(\theta)\,\ddot\theta + C(\theta, \dot\theta)\,\dot\theta + N(\theta) = \tau

τ are the torques at the joints (motor torque × capstan ratio). Source of M and N: Çavuşoğlu, Feygin & Tendick 2002.
C is derived from M by Christoffel symbols, so that Ṁ − 2C is skew-symmetric: a transcription of the published C has a
wrong sign.
"""

import numpy as np
from numba import njit

from geometry.physics import GRAVITY
from geometry.vectors import Triple
from models.phantom.kinematics import Matrix3, Vec3
from models.phantom.parameters import PREMIUM_1_5

_P = PREMIUM_1_5
L1 = _P.l1
L2 = _P.l2
L3 = _P.l3
M_A = _P.m_a
M_C = _P.m_c
# Bars be and c rotate with θ2, df and a with θ3: inertia of each pair about the vertical at angle 0 (yy) and 90° (zz).
UPPER_YY = _P.inertia_be[1] + _P.inertia_c[1]
UPPER_ZZ = _P.inertia_be[2] + _P.inertia_c[2]
FORE_YY = _P.inertia_df[1] + _P.inertia_a[1]
FORE_ZZ = _P.inertia_df[2] + _P.inertia_a[2]
BASE_YY = _P.inertia_base_yy
M22 = _P.inertia_be[0] + _P.inertia_c[0] + L1 * L1 * (M_A + 0.25 * M_C)
M33 = _P.inertia_df[0] + _P.inertia_a[0] + 0.25 * L2 * L2 * M_A + L3 * L3 * M_C
COUPLING = 0.5 * L1 * (L2 * M_A + L3 * M_C)
WEIGHT_2 = GRAVITY * (L1 * M_A + _P.l5 * _P.m_be + 0.5 * L1 * M_C)
WEIGHT_3 = GRAVITY * (0.5 * L2 * M_A + L3 * M_C - _P.l6 * _P.m_df)


@njit
def mass_matrix(theta: Vec3) -> Matrix3:
    """M(θ), symmetric [kg m²]; the published numbers include the reflected inertia of the rotors."""
    s2, c2 = np.sin(theta[1]), np.cos(theta[1])
    s3, c3 = np.sin(theta[2]), np.cos(theta[2])
    reach_a = L1 * c2 + 0.5 * L2 * s3
    reach_c = 0.5 * L1 * c2 + L3 * s3
    m11 = (
        BASE_YY
        + UPPER_YY * c2 * c2
        + UPPER_ZZ * s2 * s2
        + FORE_YY * c3 * c3
        + FORE_ZZ * s3 * s3
        + M_A * reach_a * reach_a
        + M_C * reach_c * reach_c
    )
    m23 = -COUPLING * np.sin(theta[1] - theta[2])
    return (m11, 0.0, 0.0), (0.0, M22, m23), (0.0, m23, M33)


@njit
def coriolis_matrix(theta: Vec3, theta_dot: Vec3) -> Matrix3:
    """C(θ, θ̇) with C_ij = ½ Σ_k (∂_k M_ij + ∂_j M_ik − ∂_i M_jk) θ̇_k [N m s/rad]."""
    s2, c2 = np.sin(theta[1]), np.cos(theta[1])
    s3, c3 = np.sin(theta[2]), np.cos(theta[2])
    reach_a = L1 * c2 + 0.5 * L2 * s3
    reach_c = 0.5 * L1 * c2 + L3 * s3
    half_dm11_2 = (UPPER_ZZ - UPPER_YY) * s2 * c2 - L1 * s2 * (M_A * reach_a + 0.5 * M_C * reach_c)
    half_dm11_3 = (FORE_ZZ - FORE_YY) * s3 * c3 + c3 * (0.5 * L2 * M_A * reach_a + L3 * M_C * reach_c)
    dm23_2 = -COUPLING * np.cos(theta[1] - theta[2])
    w1, w2, w3 = theta_dot[0], theta_dot[1], theta_dot[2]
    return (
        (half_dm11_2 * w2 + half_dm11_3 * w3, half_dm11_2 * w1, half_dm11_3 * w1),
        (-half_dm11_2 * w1, 0.0, -dm23_2 * w3),
        (-half_dm11_3 * w1, dm23_2 * w2, 0.0),
    )


@njit
def gravity_torques(theta: Vec3) -> Triple:
    """N(θ) = ∂V/∂θ: the joint torques that hold the arm against gravity along −y of the device frame [N m]."""
    return 0.0, WEIGHT_2 * np.cos(theta[1]), WEIGHT_3 * np.sin(theta[2])
