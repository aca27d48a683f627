"""Certificates of a run's field: what is known of its stability, passivity and energy before it is felt."""

import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from controllers.certificates.energy import energy
from controllers.certificates.hand import HandRange
from controllers.certificates.laws import FOLLOW_LAW, LAWS
from controllers.certificates.passivity import passivity
from controllers.certificates.region import region
from controllers.certificates.report import Certificate, CertificateError, Verdict, hash_of, hashes_of
from controllers.certificates.stability import River, boundary, stability
from controllers.errors import ParameterError
from controllers.safety import ForceLimiter
from experiments.certified_clips import certify_clips
from experiments.certified_device import phantom_device
from experiments.certified_field import (
    certificate_inputs,
    certified_curves,
    certified_laws,
    certified_sampling,
    read_certificate,
)
from experiments.certified_leading import certify_leading, leading_field, leading_regimes, leading_river
from experiments.certified_rivers import certify_rivers
from experiments.config import RunConfig
from models.mocap.clip import Clip

Array = npt.NDArray[np.float64]

CERTIFICATE, PAGE, PLOT = "certificate.json", "certificate.html", "stability.png"
REGION_PLOT = "region.png"


def certified_rivers(config: RunConfig, delay: float = 0.0) -> dict[str, River]:
    """The laws of a run as they are certified, with a delay of the torques [s]; named as in `certified_laws`.

    A bunny is taken to run at the clock's pace.

    Raises
    ------
    ParameterError
        If there is no certificate for the run's mode, or a number is out of its interval.
    """
    curves, device, sampling = certified_curves(config), phantom_device(), certified_sampling(config, delay)
    return {
        name: River(LAWS[law], stiffness, damping, width, curves[""], device, sampling)
        for name, (law, stiffness, damping, width) in certified_laws(config).items()
    }


def certify(rivers: Mapping[str, River], hands: HandRange, push: float) -> dict[str, Verdict]:
    """Stability and region with hands within intervals, passivity; and the bound for a push [N], FOLLOW's alone."""
    verdicts: dict[str, Verdict] = {}
    for name, river in rivers.items():
        verdicts["stability" + name] = stability(river, hands.hands())
        verdicts["passivity" + name] = passivity(river)
        ceiling = ForceLimiter(river.sampling.period).peak
        verdicts["region" + name] = region(river, hands, ceiling, verdicts["stability" + name])
        if river.law is FOLLOW_LAW:
            verdicts["energy" + name] = energy(river, push, ceiling)
    return verdicts


def certify_into(
    config: RunConfig,
    out: Path,
    delay: float = 0.0,
    hands: HandRange | None = None,
    push: float = 1.0,
    clips: Sequence[Clip] = (),
) -> Certificate:
    """Certify a run's field and clips, or take the certificate that the folder holds if it is of the same inputs.

    Parameters
    ----------
    config : RunConfig
        Of the run.
    out : Path
        Folder; written are ``certificate.json``, ``certificate.html``, ``stability.png``, ``region.png``.
    delay : float
        Of the torques [s].
    hands : HandRange, optional
        Intervals of the hand's impedance.
    push : float
        U_max of the bound on the distance [N].
    clips : sequence of Clip
        Whose flights are judged besides; in the mode "lead" the first of them is led.

    Raises
    ------
    ControllerError, SimError
        If a number is out of its interval, or the curve is out of the workspace.
    """
    hands = hands or HandRange()
    inputs = certificate_inputs(config, delay, hands, push, clips)
    file = out / CERTIFICATE
    if file.exists() and (out / PAGE).exists():
        try:
            held = read_certificate(file)
            held.check(inputs)
            return held
        except CertificateError:
            pass  # of another river, or of none: certified anew
    main, verdicts = _field_verdicts(config, delay, hands, push, clips)
    if clips:
        verdicts |= certify_clips(clips)
    certificate = Certificate(verdicts, hash_of(inputs), hashes_of(inputs))
    out.mkdir(parents=True, exist_ok=True)
    stability_figure(main, verdicts["stability"]).savefig(out / PLOT, dpi=150)
    if "region" in verdicts and "ellipse" in verdicts["region"].figures:
        region_figure(verdicts["region"]).savefig(out / REGION_PLOT, dpi=150)
    (out / PAGE).write_text(certificate_page(certificate), encoding="utf-8")
    file.write_text(json.dumps(certificate.to_json(), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return certificate


def _field_verdicts(
    config: RunConfig, delay: float, hands: HandRange, push: float, clips: Sequence[Clip]
) -> tuple[River, dict[str, Verdict]]:
    """The river that is drawn, and all verdicts on the field."""
    if config.mode == "lead":
        if not clips:
            raise ParameterError("a certificate of leading is of a clip that is led; give one")
        field, curve = leading_field(config, clips[0]), certified_curves(config)[""]
        device, sampling = phantom_device(), certified_sampling(config, delay)
        main = leading_river(field, leading_regimes(field)[""][0], curve, device, sampling)
        return main, certify_leading(field, curve, device, sampling, hands)
    rivers = certified_rivers(config, delay)
    verdicts, main = certify(rivers, hands, push), rivers[""]
    if config.mode == "rivers":
        return main, verdicts | certify_rivers(config, main, hands, push, certified_curves(config))
    for name, curve in certified_curves(config).items():
        if name:
            verdicts["stability" + name] = stability(main._replace(curve=curve), hands.hands())
    return main, verdicts


def stability_figure(river: River, verdict: Verdict) -> Figure:
    """Boundary of the gains with the river's own, and the critical stiffness along the curve."""
    damping = np.geomspace(0.1 * max(river.b_d, 0.1), 100.0, 28)
    critical = boundary(river, damping)
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    gains, along = figure.subplots(1, 2)
    gains.fill_between(damping, 1.0, np.maximum(critical, 1.0), color="#dbe7f4", label="stable at every phase, no hand")
    gains.plot(damping, critical, color="#2f6db3")
    gains.plot(river.b_d, river.k_r, "o", color="#c2473b", label="this river")
    gains.set(xscale="log", yscale="log", xlabel="b_d [N s/m]", ylabel="k_r [N/m]", ylim=(10.0, None))
    gains.set_title("stability boundary", loc="left")
    gains.legend(frameon=False, fontsize=8, loc="lower center")
    phases = np.asarray(verdict.figures["phases"], dtype=np.float64)
    along.plot(phases, np.asarray(verdict.figures["critical_stiffness"], dtype=np.float64), color="#2f6db3")
    along.axhline(river.k_r, color="#c2473b", label="this river")
    along.set(yscale="log", xlabel="phase [s]", ylabel="critical k_r [N/m]")
    along.set_title("along the curve, worst hand", loc="left")
    along.legend(frameon=False, fontsize=8)
    return figure


def region_figure(verdict: Verdict) -> Figure:
    """Edge of the region and of the ball over offset and wrong speed, for the lightest and the heaviest hand."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    edges = np.asarray(verdict.figures["ellipse"], dtype=np.float64)
    masses = np.asarray(verdict.figures["masses"], dtype=np.float64)
    for axes, (outer, inner), mass in zip(figure.subplots(1, 2), edges, masses, strict=True):
        label = "region, firm hands" if "firm_hands" in verdict.figures else "region"
        axes.fill(1e3 * outer[:, 0], outer[:, 1], color="#dbe7f4", label=label)
        axes.plot(1e3 * outer[:, 0], outer[:, 1], color="#2f6db3")
        axes.fill(1e3 * inner[:, 0], inner[:, 1], color="#c2473b", alpha=0.5, label="ball that is reached")
        axes.set(xlabel="offset across the curve [mm]", ylabel="speed off its pace [m/s]")
        axes.set_title(f"{mass:.2f} kg at the tip", loc="left")
        axes.legend(frameon=False, fontsize=8, loc="upper right")
    return figure


def certificate_page(certificate: Certificate) -> str:
    """A readable page of a certificate, with the plot beside it."""
    colour = {"certified": "#2e7d4f", "refuted": "#c2473b", "unknown": "#8a6d1f"}
    parts = [
        "<!doctype html><meta charset='utf-8'><title>Certificate</title>",
        "<style>body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:2rem auto;padding:0 1rem;color:#222}"
        "td{padding:.1rem .8rem .1rem 0;vertical-align:top}img{width:100%}small{color:#666}</style>",
        f"<h1>Certificate</h1><p><small>inputs {escape(certificate.inputs)}</small></p>",
    ]
    for name, verdict in certificate.verdicts.items():
        numbers = {key: value for key, value in verdict.figures.items() if isinstance(value, float)}
        rows = "".join(f"<tr><td>{escape(key)}</td><td>{value:.5g}</td></tr>" for key, value in numbers.items())
        margin = "" if verdict.margin is None else f" <small>margin {verdict.margin:.4g}</small>"
        parts.append(
            f"<h2>{escape(name)}: <span style='color:{colour[verdict.verdict]}'>{verdict.verdict}</span>{margin}</h2>"
            f"<p>{escape(verdict.reason)}</p><ul>{''.join(f'<li>{escape(a)}</li>' for a in verdict.assumptions)}</ul>"
            f"<table>{rows}</table>"
        )
        if verdict.counterexample:
            parts.append(f"<p>Counterexample: <code>{escape(str(dict(verdict.counterexample)))}</code></p>")
    parts.append(f"<img src='{PLOT}' alt='stability boundary'>")
    if "region" in certificate.verdicts and "ellipse" in certificate.verdicts["region"].figures:
        parts.append(f"<img src='{REGION_PLOT}' alt='region of attraction'>")
    return "\n".join(parts)
