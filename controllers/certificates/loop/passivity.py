r"""Passivity of the sampled river: a stronger property than stability, independent of the (passive) hand.

A virtual wall of stiffness K and damping B on a device of damping b is passive if b > K T/2 + |B| (Colgate & Schenkel
1997). Their general form, for a discrete impedance H(z) and all ω up to the Nyquist frequency,

.. math:: b > \frac{T}{2}\,\frac{1}{1 - \cos\omega T}\,\mathrm{Re}\bigl((1 - e^{-i\omega T})\,H(e^{i\omega T})\bigr)

includes delay and velocity filter exactly. A wall with position quantisation Δ, on a device with Coulomb friction f_c,
is passive for K ≤ min(2b/T, 2f_c/Δ) (Abbott & Okamura 2005). b, f_c and Δ are those of the device, mapped to the tip in
the directions across the curve; both conditions are for one axis and are applied to the worst direction.
"""

import numpy as np

from controllers.certificates.loop.hand import MAX_STIFFNESS, HandImpedance
from controllers.certificates.loop.linear_loop import LinearLoop, joint_motion
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver, counterexample
from controllers.certificates.report import Verdict
from geometry.arrays import Array

N_DIRECTIONS = 24  # directions across the curve, over half a turn; half or four times as many need the same damping
# Number of frequencies up to the Nyquist frequency, where most damping is needed; a quarter as many give the same.
N_FREQUENCIES = 4000


def tip_friction(river: CertifiedRiver, linear: LinearLoop) -> tuple[Array, Array, Array]:
    """The device's b [N s/m], f_c [N] and Δ [m] at the tip, in directions across the curve, each (n, DIRECTIONS).

    For a motion n of the tip the joints move by J⁻¹ n: b(n) = Σ D_i (J⁻¹n)_i², f_c(n) = Σ f_i |(J⁻¹n)_i|. A count
    of encoder i changes the measured position by nᵀJ_i Δ_i; Δ(n) is the largest of these.
    """
    tangent = linear.velocity / np.linalg.norm(linear.velocity, axis=1, keepdims=True)
    plane = np.linalg.svd(tangent[:, None, :])[2][:, 1:, :]
    angle = np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    directions = circle @ plane
    joints = joint_motion(linear.jacobian[:, None], directions)
    device = river.device
    count = np.abs(directions @ linear.jacobian) * np.array(device.encoder_step)
    return joints**2 @ np.array(device.viscous), np.abs(joints) @ np.array(device.coulomb), count.max(axis=2)


def damping_needed(k: float, b: float, sampling: Sampling) -> tuple[float, float]:
    """Device damping [N s/m] needed for passivity of stiffness k and damping b, and the critical frequency [rad/s].

    The impedance is the servo's: backward difference, first-order low-pass, delay rounded up to whole periods.
    """
    period, keep = sampling.period, sampling.keep
    angle = np.pi * (np.arange(N_FREQUENCIES) + 1.0) / N_FREQUENCIES
    unit_delay = np.exp(-1j * angle)
    delay = unit_delay ** (sampling.whole_delay + (sampling.rest_delay > 0.0))
    impedance = delay * (k + b * (1.0 - keep) / (1.0 - keep * unit_delay) * (1.0 - unit_delay) / period)
    needed = 0.5 * period * ((1.0 - unit_delay) * impedance).real / (1.0 - np.cos(angle))
    worst = int(np.argmax(needed))
    return float(needed[worst]), float(angle[worst] / period)


def passivity(river: CertifiedRiver) -> Verdict:
    """Verdict on passivity across the curve, for any passive hand.

    Certified by Colgate & Schenkel's general condition at every phase, in the worst direction; refuted by a passive
    hand, a spring on the stylus, that makes the loop unstable; unknown otherwise. The margin is the smallest damping of
    the device minus the needed one [N s/m].
    """
    linear = river.still()
    damping, coulomb, resolution = tip_friction(river, linear)
    needed, frequency = damping_needed(river.k_r, river.b_d, river.sampling)
    period = river.sampling.period
    wall_stiffness = np.minimum(2.0 * damping / period, 2.0 * coulomb / resolution).min(axis=1)
    margin = float(damping.min()) - needed
    figures: dict[str, object] = {
        "phases": river.phases(),
        "damping": damping.min(axis=1),
        "damping_needed": needed,
        "damping_needed_unfiltered": 0.5 * river.k_r * period + river.b_d,
        "stiffness_colgate": 2.0 * damping.min(axis=1) / period,
        "stiffness_quantised": 2.0 * (coulomb / resolution).min(axis=1),
        "stiffness_abbott_okamura": wall_stiffness,
        "frequency": frequency,
    }
    assumptions = ("one axis at a time, the worst direction across the curve", "viscous friction of the device alone")
    reason = (
        f"the device's damping is {damping.min():.3g} N s/m, {needed:.3g} N s/m are needed at {frequency:.0f} rad/s; "
        f"springs alone are passive up to {wall_stiffness.min():.3g} N/m (Abbott & Okamura)"
    )
    if margin > 0.0:
        return Verdict("certified", reason, margin, assumptions, {}, figures)
    for stiffness in np.geomspace(10.0, MAX_STIFFNESS, 24):
        hand = HandImpedance(stiffness=float(stiffness))
        radius = river.loop(hand).radius(river.k_r, river.b_d)
        if radius.max() > 1.0:
            example = counterexample(river, hand, int(radius.argmax()))
            reason += f"; a spring of {stiffness:.3g} N/m on the stylus makes it unstable"
            return Verdict("refuted", reason, margin, assumptions, example, figures)
    return Verdict("unknown", f"{reason}; no spring was found that makes it unstable", margin, assumptions, {}, figures)
