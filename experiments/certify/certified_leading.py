"""Certificate of LEADING: stability in every regime of its force along the default S, in all directions of the path."""

from dataclasses import replace

import numpy as np

from controllers.certificates.loop.device import Device
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.leading_law import Regime, walking
from controllers.certificates.loop.passivity import passivity
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver, stability
from controllers.certificates.report import FROM_WORST, Verdict
from controllers.curves.trajectory import Trajectory
from controllers.fields.leading import Leading
from controllers.safety.limiter import ForceLimiter
from experiments.config.modes import Lead
from experiments.config.run_config import RunConfig
from experiments.setups.modes.lead import leading
from experiments.setups.parts.led_figure import is_authored, led_map
from models.humanoid.skeleton import figure_model
from models.mocap.motion.clip import Clip

DIRECTIONS = 0.25 * np.pi * np.arange(4)
_ASSUMPTIONS = (
    "k_r is LEADING's k_l, with k_z in proportion; b_d is its b",
    "the figure is frozen: its speed is independent of the hand, or it or its pull is at a bound; where it follows "
    "freely (walker_radius) it is part of the state",
)


def leading_field(config: RunConfig, mode: Lead, clip: Clip) -> Leading:
    """The field of a run in the mode "lead".

    Raises
    ------
    ParameterError
        If a number is out of its interval, or the clip cannot be led.
    """
    figure = figure_model(config.scene.stature, config.scene.mass)
    return leading(mode, led_map(clip, figure, is_authored(config))[1])


def leading_regimes(field: Leading) -> dict[str, list[Regime]]:
    """Regimes by the suffix of their verdicts' names, for headings of the path that represent all directions.

    - "": the stylus is on the path, and only the spring across it acts. If only the spring along it acts, the law is
      the same with t for n, which the headings include.
    - ``_back``: the stylus is on the path, and both springs act: the figure is held back.
    - ``_aside``: it is beyond the path's front, and the spring across acts: it is beside what the figure can reach.
    - ``_beyond``: likewise, and both act: it is also too far ahead, as far as the limiter lets a hand pull it.
    """
    lead, curvature = field.walking.lead[0], field.walking.curvature
    pull_distance = field.walking.scale * ForceLimiter(1e-3).peak / max(field.k_l, 1e-3)
    near, far = curvature * lead, curvature * (lead + pull_distance)
    sides = [(sign, heading) for sign in (1.0, -1.0) for heading in DIRECTIONS[::2].tolist()]
    return {
        "": [Regime(False, True, heading=heading) for heading in DIRECTIONS.tolist()],
        "_back": [Regime(True, True)],
        "_aside": [Regime(False, True, True, sign * near, heading) for sign, heading in sides],
        "_beyond": [Regime(True, True, True, sign * far, heading) for sign, heading in sides],
    }


def leading_river(
    field: Leading, regime: Regime, curve: Trajectory, device: Device, sampling: Sampling
) -> CertifiedRiver:
    """LEADING in one regime, in the form that certificates take."""
    law = regime.law(field.walking.scale, field.k_z / max(field.k_l, 1e-3))
    return CertifiedRiver(law, field.k_l, field.b, float("inf"), curve, device, sampling)


def certify_leading(
    field: Leading, curve: Trajectory, device: Device, sampling: Sampling, hands: HandRange
) -> dict[str, Verdict]:
    """Verdicts on stability in every regime, passivity and power; the region of attraction is unknown.

    Parameters
    ----------
    field : Leading
        The law.
    curve : Trajectory
        Curve along which the loop is linearised.
    device, sampling, hands
        As in `stability`.
    """
    verdicts: dict[str, Verdict] = {}
    for name, regimes in leading_regimes(field).items():
        found = [stability(leading_river(field, it, curve, device, sampling), hands.hands()) for it in regimes]
        worst = min(found, key=lambda verdict: (FROM_WORST.index(verdict.verdict), verdict.margin or 0.0))
        verdicts["stability" + name] = replace(worst, assumptions=(*worst.assumptions, *_ASSUMPTIONS))
    radius = max(_walker_radius(field, regime, curve, device, sampling, hands) for regime in _FOLLOWING_REGIMES)
    for name in ("stability", "stability_back"):
        verdict = verdicts[name]
        figures = {**verdict.figures, "walker_radius": radius}
        if radius >= 1.0 and verdict.verdict == "certified":
            reason = f"stable with the walker frozen, but {radius:.5g} is the spectral radius with it; {verdict.reason}"
            verdict = Verdict("unknown", reason, verdict.margin, verdict.assumptions, {}, figures)
        verdicts[name] = replace(verdict, figures=figures)
    held = leading_river(field, Regime(True, True), curve, device, sampling)
    return verdicts | {"passivity": passivity(held), "energy": leading_energy(field), "region": _NO_REGION}


_NO_REGION = Verdict(
    "unknown",
    "no region is sought: a hand within the dead bands feels no spring, so there is no curve to which it is drawn",
)


def leading_energy(field: Leading) -> Verdict:
    r"""Verdict on the power that the force gives a hand, for any motion of hand and figure.

    .. math:: F \cdot v = f(p, t) \cdot v - b\,|v|^2 \le |f|^2 / 4 b

    with f the force of the springs. The bound needs no potential; ahead and aside the force has none. It is evaluated
    for springs that pull with the limiter's force.
    """
    force = ForceLimiter(1e-3).peak
    if field.b == 0.0:
        return Verdict("unknown", "without damping the power is unbounded: ahead and aside there is no potential")
    power = force**2 / (4.0 * field.b)
    reason = (
        f"while the springs pull at most {force:g} N they give a hand at most {power:.3g} W, and drive it at most at "
        f"{force / field.b:.3g} m/s; ahead and aside they can do so for as long as it goes round in a loop"
    )
    figures: dict[str, object] = {"power_bound": power, "speed_bound": force / field.b}
    assumptions = ("damping by the hand's own velocity: passivity judges what sampling, filter and delay add",)
    return Verdict("certified", reason, None, assumptions, {}, figures)


_FOLLOWING_REGIMES = (
    Regime(True, True),
    *(Regime(True, False, True, heading=heading) for heading in DIRECTIONS.tolist()),
)


def _walker_radius(
    field: Leading, regime: Regime, curve: Trajectory, device: Device, sampling: Sampling, hands: HandRange
) -> float:
    """Largest spectral radius, over phases and hands, with the walker as part of the state."""
    river = leading_river(field, regime, curve, device, sampling)
    settings, radii = field.walking, list[float]()
    for hand in hands.hands():
        matrices = walking(river.loop(hand), regime, settings.scale, settings.rate, field.k_l, field.b)
        radii.append(np.abs(np.linalg.eigvals(matrices)).max())
    return float(max(radii))
