"""Parameters of the PHANToM Premium 1.5, with the source of every number.

Sources: [C] Çavuşoğlu, Feygin & Tendick, "A Critical Study of the Mechanical and Electrical Properties of the PHANToM
Haptic Interface", Presence 11(6), 2002, and the technical report of 2001 behind it; [S] SensAble's data sheet of the
Premium 1.5, from secondary sources; [M] Maxon's RE 25, as in the open models; [O] an open C++ model of the Premium 1.5
built on mahi-util; [E] our estimate.
"""

from dataclasses import dataclass

import numpy as np

from geometry.vectors import Triple

Pair = tuple[float, float]


def _radians(low: float, high: float) -> Pair:
    return float(np.deg2rad(low)), float(np.deg2rad(high))


@dataclass(frozen=True)
class PhantomParameters:
    """Geometry, inertia, drives, sensors and limits of a three-motor Phantom.

    Bars: ``be`` is the upper arm b with the assembly e behind its pivot; ``df`` the short driven link d with its
    counterweight f; ``c`` the long thin rod; ``a`` the forearm. At θ = 0, be and c are along z, df and a along y.

    Attributes
    ----------
    l1, l2 : float
        Lengths from pivot to elbow and from elbow to tip [m] [C].
    l3 : float
        Length from pivot to the lower end of df: the short side of the parallelogram [m] [C].
    l5, l6 : float
        Centre of mass of be along the bar (negative: behind the pivot), and of df behind the pivot [m] [C].
    m_a, m_c, m_be, m_df : float
        Masses [kg] [C].
    inertia_a, inertia_c : (float, float, float)
        Moments of inertia xx, yy, zz about the bar's centre of mass [kg m²] [C].
    inertia_be, inertia_df : (float, float, float)
        Moments of inertia xx, yy, zz about the pivot [kg m²] [C]; xx violates the triangle inequality, so it includes
        the reflected rotor inertia.
    inertia_base_yy : float
        Moment of inertia of the turret with its motor about the vertical axis [kg m²] [C].
    capstan : (float, float, float)
        Capstan ratios: motor turns per joint turn [C].
    rotor_inertia : float
        Rotor inertia of one motor [kg m²] [O]; public models of the RE 25 have 1.03e-6 and 1.07e-6.
    continuous_motor_torque, stall_motor_torque : float
        Continuous and stall torque at the motor shaft [N m] [M].
    encoder_counts : int
        Counts per motor turn after quadrature [C].
    gimbal_counts : int
        Counts per turn of a gimbal joint [E].
    coulomb_friction : (float, float, float)
        Coulomb friction at the joint [N m]: 0.04 N of back-drive friction at the tip [S] times the lever l1, l1, l2.
    viscous_friction : (float, float, float)
        Viscous friction at the joint [N m s/rad] [O].
    gimbal_inertia : (float, float, float)
        Inertia of the stylus about its gimbal axes [kg m²] [E]; as joint armature, it leaves the published M unchanged.
    gimbal_damping : float
        Damping of the gimbal joints [N m s/rad] [E].
    limit : three (float, float)
        Range of θ1, θ2, θ3 [rad] [O].
    elbow_limit : (float, float)
        Range of θ3 − θ2 [rad] [O].
    gimbal_limit : three (float, float)
        Range of yaw, pitch and roll of the stylus [rad]: 297°, 260° and 335° of [S], taken as symmetric.
    """

    l1: float
    l2: float
    l3: float
    l5: float
    l6: float
    m_a: float
    m_c: float
    m_be: float
    m_df: float
    inertia_a: Triple
    inertia_c: Triple
    inertia_be: Triple
    inertia_df: Triple
    inertia_base_yy: float
    capstan: Triple
    rotor_inertia: float
    continuous_motor_torque: float
    stall_motor_torque: float
    encoder_counts: int
    gimbal_counts: int
    coulomb_friction: Triple
    viscous_friction: Triple
    gimbal_inertia: Triple
    gimbal_damping: float
    limit: tuple[Pair, Pair, Pair]
    elbow_limit: Pair
    gimbal_limit: tuple[Pair, Pair, Pair]

    @property
    def armature(self) -> Triple:
        """Rotor inertia felt at the joints, J η² [kg m²]."""
        n1, n2, n3 = self.capstan
        return self.rotor_inertia * n1**2, self.rotor_inertia * n2**2, self.rotor_inertia * n3**2

    @property
    def continuous_torque(self) -> Triple:
        """Continuous joint torque of the motors [N m]."""
        n1, n2, n3 = self.capstan
        return self.continuous_motor_torque * n1, self.continuous_motor_torque * n2, self.continuous_motor_torque * n3

    @property
    def peak_torque(self) -> Triple:
        """Joint torque at stall [N m]."""
        n1, n2, n3 = self.capstan
        return self.stall_motor_torque * n1, self.stall_motor_torque * n2, self.stall_motor_torque * n3

    @property
    def encoder_step(self) -> Triple:
        """Resolution of the encoders at the joints [rad]."""
        n1, n2, n3 = self.capstan
        turn = 2.0 * np.pi / self.encoder_counts
        return turn / n1, turn / n2, turn / n3


PREMIUM_1_5 = PhantomParameters(
    l1=0.215,
    l2=0.170,
    l3=0.0325,
    l5=-0.0368,
    l6=0.0527,
    m_a=0.0202,
    m_c=0.0249,
    m_be=0.2359,
    m_df=0.1906,
    inertia_a=(0.4864e-4, 0.001843e-4, 0.4864e-4),
    inertia_c=(0.959e-4, 0.959e-4, 0.0051e-4),
    inertia_be=(11.09e-4, 10.06e-4, 0.591e-4),
    inertia_df=(7.11e-4, 0.629e-4, 6.246e-4),
    inertia_base_yy=11.87e-4,
    capstan=(13.3, 11.2, 11.2),
    rotor_inertia=1.08e-6,
    continuous_motor_torque=0.0286,
    stall_motor_torque=0.129,
    encoder_counts=4096,
    gimbal_counts=4096,
    coulomb_friction=(0.04 * 0.215, 0.04 * 0.215, 0.04 * 0.170),
    viscous_friction=(5e-4, 5e-4, 5e-4),
    gimbal_inertia=(2e-5, 2e-5, 2e-6),
    gimbal_damping=1e-4,
    limit=(_radians(-90, 90), _radians(-124, 119), _radians(-29, 214)),
    elbow_limit=_radians(-65, 55),
    gimbal_limit=(_radians(-148.5, 148.5), _radians(-130, 130), _radians(-167.5, 167.5)),
)

MIN_TIP_MASS = 0.03  # [kg] apparent mass of the bare linkage at the tip in its lightest direction, at θ = 0
