"""Certificates of a run's field and of a clip, computed before a run and written to a folder."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA, JudgementCriteria
from controllers.certificates.loop.energy import energy
from controllers.certificates.loop.governed import governed_stability
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.laws import LAWS, FollowForce, follow_law
from controllers.certificates.loop.passivity import passivity
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.region.region import region
from controllers.certificates.report import Certificate, CertificateError, Verdict, hash_of, hashes_of, without_laws
from controllers.errors import ParameterError
from controllers.safety.limiter import ForceLimiter
from experiments.certify.certificate_page import certificate_page, flights_figure, region_figure, stability_figure
from experiments.certify.certified_clips import certify_clips
from experiments.certify.certified_device import phantom_device
from experiments.certify.certified_field import (
    certificate_inputs,
    certified_curves,
    certified_options,
    certified_sampling,
    given_curves,
)
from experiments.certify.certified_leading import certify_leading, leading_field, leading_regimes, leading_river
from experiments.certify.certified_rivers import certify_rivers
from experiments.certify.executed_field import walled
from experiments.config.modes import Lead, Rivers
from experiments.config.run_config import RunConfig
from experiments.files.certificate_files import OPTIONS, clip_inputs, read_certificate
from experiments.files.device_files import linkage_of
from experiments.files.figure_files import save_figure
from experiments.files.json_text import json_text
from experiments.flights.ballistics import clip_ballistics
from experiments.setups.certified_law import certified_laws, governor_drag, uncertified_parts
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.pace import compensation
from geometry.whole_files import write_text
from models.humanoid.skeleton import DEFAULT_STATURE
from models.mocap.library import embedded_names, load
from models.mocap.motion.clip import Clip
from sim.errors import SimError

CERTIFICATE, PAGE = "certificate.json", "certificate.html"
_MOMENT_ASSUMPTION = "the moment on the stylus (--orientation-*) has no effect: the device's motors give a force only"
PLOT, REGION_PLOT, FLIGHTS_PLOT = "stability.png", "region.png", "flights.png"


def certified_rivers(config: RunConfig, delay: float = 0.0) -> dict[str, CertifiedRiver]:
    """The laws of a run in the form that is certified, with a delay of the torques [s]; named as in `certified_laws`.

    A bunny is assumed to run at the clock's pace.

    Raises
    ------
    ParameterError
        If a number is out of its interval.
    """
    course, sampling = certified_curves(config)[""], certified_sampling(config, delay)
    device = phantom_device(linkage_of(config.device))
    return {
        name: CertifiedRiver(
            follow_law(1.0 - compensation(given_curves(config)[""], course)) if law == "parallel" else LAWS[law],
            stiffness, damping, width, course, device, sampling,
        )
        for name, (law, stiffness, damping, width) in certified_laws(config).items()
    }  # fmt: skip


def certify(
    rivers: Mapping[str, CertifiedRiver], hands: HandRange, push: float, drag: float = 0.0
) -> dict[str, Verdict]:
    """Verdicts on stability and region of attraction for a range of hands, and on passivity; for FOLLOW also on energy.

    `push` [N] is the hand's force for the energy bound; `drag` [N s/m] is that of a governor in addition to the laws.
    """
    verdicts: dict[str, Verdict] = {}
    for name, river in rivers.items():
        verdicts["stability" + name] = governed_stability(river, drag, hands.hands())
        verdicts["passivity" + name] = passivity(river)
        ceiling = ForceLimiter(river.sampling.period).peak
        verdicts["region" + name] = region(river, hands, ceiling, verdicts["stability" + name])
        if isinstance(river.law.force, FollowForce):
            verdicts["energy" + name] = energy(river, push, ceiling)
    if drag > 0.0:
        for name in verdicts:
            if name.startswith(("energy", "region")) and verdicts[name].verdict != "refuted":
                verdicts[name] = without_laws(verdicts[name], ("the governor (--governor)",))
    return verdicts


def certify_into(
    config: RunConfig, out: Path, delay: float = 0.0, hands: HandRange | None = None, push: float = 1.0,
    clips: Sequence[Clip] = (), criteria: JudgementCriteria = DEFAULT_CRITERIA,
) -> Certificate:  # fmt: skip
    """Certify a run's field and clips, or return the certificate that the folder holds if it has the same inputs.

    Parameters
    ----------
    config : RunConfig
        Configuration of the run.
    out : Path
        Folder to which ``certificate.json``, ``certificate.html``, ``certified.json`` (the options), ``stability.png``
        and ``region.png`` are written.
    delay : float
        Delay of the torques [s].
    hands : HandRange, optional
        Intervals of the hand's impedance.
    push : float
        U_max, the hand's force in the bound on the distance [N].
    clips : sequence of Clip
        Clips whose flights are judged too; in the mode "lead" the figure walks with the first one.
    criteria : JudgementCriteria
        Tolerances of flights, and the floor's friction.

    Raises
    ------
    ControllerError, SimError
        If a number is out of its interval, or the curve is out of the workspace.
    """
    config, hands = resolved(config), hands or HandRange()
    inputs = certificate_inputs(config, delay, hands, push, clips, criteria)
    existing = _existing_certificate(out, inputs)
    if existing is not None:
        return existing
    main, verdicts = _field_verdicts(config, delay, hands, push, clips)
    if clips:
        verdicts |= certify_clips(clips, criteria, config.figure.stature / DEFAULT_STATURE)
    certificate = Certificate(verdicts, hash_of(inputs), hashes_of(inputs))
    plots: dict[str, tuple[Figure, str]] = {PLOT: (stability_figure(main, verdicts["stability"]), "stability boundary")}
    if "region" in verdicts and "ellipse" in verdicts["region"].figures:
        plots[REGION_PLOT] = (region_figure(verdicts["region"]), "region of attraction")
    _write_certificate(certificate, plots, out)
    write_text(out / OPTIONS, json_text(certified_options(config, delay, hands, push)) + "\n")
    return certificate


def certify_clip_into(name: str, out: Path, criteria: JudgementCriteria) -> Certificate:
    """Certify flights and turns of a clip, or return the certificate that the folder holds if it has the same inputs.

    Parameters
    ----------
    name : str
        An embedded clip, or a motion file.
    out : Path
        Folder to which ``certificate.json``, ``certificate.html`` and ``flights.png`` are written.
    criteria : JudgementCriteria
        Tolerances of flights, and the floor's friction.

    Raises
    ------
    ModelError
        If there is no such clip, or the file cannot be read.
    """
    (clip,), notes = load_clips([name], raw=True)
    existing = _existing_certificate(out, clip_inputs(clip, criteria))
    if existing is not None:
        return existing
    report = None if name in embedded_names() else load(Path(name)).report
    scaled = () if report is None else (f"lengths, and gravity with them, are scaled to the figure: {report.scaling}",)
    found = clip_ballistics(clip, criteria, (*scaled, *notes))
    _write_certificate(found.certificate, {FLIGHTS_PLOT: (flights_figure(found), "flights and admissible rates")}, out)
    return found.certificate


def _existing_certificate(out: Path, inputs: Mapping[str, object]) -> Certificate | None:
    """The certificate in a folder, if it has these inputs and its page exists; else None.

    Raises
    ------
    SimError
        If the folder has a page of that name without a certificate.
    """
    if (out / PAGE).exists() and not (out / CERTIFICATE).exists():
        raise SimError(f"{out / PAGE}: already exists, without a certificate; choose another --out, or move it")
    if not ((out / CERTIFICATE).exists() and (out / PAGE).exists()):
        return None
    try:
        existing = read_certificate(out / CERTIFICATE)
        existing.check(inputs)
    except CertificateError:
        return None  # not a certificate, or of other inputs
    return existing


def _write_certificate(certificate: Certificate, plots: Mapping[str, tuple[Figure, str]], out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    if (out / CERTIFICATE).exists():
        for name in (PLOT, REGION_PLOT, FLIGHTS_PLOT, OPTIONS):
            (out / name).unlink(missing_ok=True)
    for file, (figure, _) in plots.items():
        save_figure(figure, out / file, dpi=150)
    shown = {file: shows for file, (_, shows) in plots.items()}
    write_text(out / PAGE, certificate_page(certificate, shown))
    text = json.dumps(certificate.to_json(), indent=2, allow_nan=False) + "\n"
    write_text(out / CERTIFICATE, text)


def _field_verdicts(
    config: RunConfig, delay: float, hands: HandRange, push: float, clips: Sequence[Clip]
) -> tuple[CertifiedRiver, dict[str, Verdict]]:
    """The law that the stability figure shows, and all verdicts on the field."""
    if isinstance(config.mode, Lead):
        if not clips:
            raise ParameterError("leading is certified for the clip that is led; give one")
        field, curve = leading_field(config, config.mode, clips[0]), certified_curves(config)[""]
        device, sampling = phantom_device(linkage_of(config.device)), certified_sampling(config, delay)
        main = leading_river(field, leading_regimes(field)[""][0], curve, device, sampling)
        return main, certify_leading(field, curve, device, sampling, hands)
    rivers, drag, omitted = certified_rivers(config, delay), governor_drag(config), uncertified_parts(config)
    verdicts, main = certify(rivers, hands, push, drag), rivers[""]
    if isinstance(config.mode, Rivers):
        verdicts |= certify_rivers(config, config.mode, main, hands, push, certified_curves(config))
    else:
        for name, curve in certified_curves(config).items():
            if name:
                verdicts["stability" + name] = governed_stability(main._replace(curve=curve), drag, hands.hands())
    if getattr(config.mode, "orientation", None) is not None:
        verdicts = {
            name: replace(it, assumptions=(*it.assumptions, _MOMENT_ASSUMPTION)) for name, it in verdicts.items()
        }
    if omitted:
        verdicts = {name: without_laws(verdict, omitted) for name, verdict in verdicts.items()}
    if getattr(config.mode, "walls", None) is not None and verdicts["stability"].verdict != "refuted":
        verdicts["stability"] = walled(config, main, verdicts["stability"], hands, clips)
    return main, verdicts
