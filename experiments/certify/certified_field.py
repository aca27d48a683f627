"""What a certificate is of, and whether it still is: laws, gains, curve, clock, device, hands, clips and code.

Nothing here needs CasADi, so a stored certificate is checked without starting it.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from controllers.certificates.flight.tolerance import JUDGING, Judging
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.report import Certificate, CertificateError, ChangedInputs
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from experiments.config.run_config import RunConfig
from experiments.setups.stretch import DAMPING
from models.mocap.clip import Clip
from models.phantom.parameters import PREMIUM_1_5
from sim.compilation.compiled import source_hash

CERTIFIED_MODES = ("follow", "bunny", "rivers", "stretch", "stretch-then-follow", "lead")


class CertifiedLaw(NamedTuple):
    """A law of force that a run uses: its name among `controllers.certificates.loop.laws.LAWS`, and its gains.

    Attributes
    ----------
    law : str
        Name.
    stiffness, damping : float
        [N/m], [N s/m].
    width : float
        ε or δ [m]; infinite if the law has none.
    """

    law: str
    stiffness: float
    damping: float
    width: float


def certified_laws(config: RunConfig) -> dict[str, CertifiedLaw]:
    """The laws that a run uses, by what is added to the names of their verdicts; that of the run's start by "".

    Near a bunny that pulls along the curve the field is FOLLOW's, to first order. Stretchy tubes seek with the switch
    open and hold with it closed; a bent curve that is performed afterwards is certified as it was before.

    Raises
    ------
    ParameterError
        If there is no certificate for the run's mode.
    """
    follow = CertifiedLaw("follow", *config.gains, config.tube)
    if config.mode == "follow":
        return {"": follow}
    if config.mode == "bunny":
        along = config.bunny_attraction == "along"
        width = float("inf") if along else config.bunny_width
        return {"": CertifiedLaw("follow" if along else "bunny", config.stiffness, config.damping, width)}
    if config.mode in ("stretch", "stretch-then-follow"):
        tubes = {
            "": CertifiedLaw("seek", config.seek, DAMPING, float("inf")),
            "_held": CertifiedLaw("hold", config.rubber, DAMPING, float("inf")),
        }
        return tubes | ({"_then": follow} if config.mode == "stretch-then-follow" else {})
    if config.mode == "rivers":
        if config.governor:
            raise ParameterError("rivers are certified without --governor")
        return {"": follow._replace(width=config.river_tube)}
    if config.mode == "lead":
        return {"": CertifiedLaw("leading", config.leash, config.damping, float("inf"))}
    raise ParameterError(
        f"no certificate is known for mode {config.mode!r}; there are those of {', '.join(CERTIFIED_MODES)}"
    )


def certified_curves(config: RunConfig) -> dict[str, Trajectory]:
    """The curve of a run by "", and the other ones of a lifted map's file by its clips' names.

    Raises
    ------
    ParameterError, SimError, OSError
        If the map has no such curve, the Phantom does not reach it, or there is no such map.
    """
    if config.mode == "lead":
        from experiments.setups.lead import s_curve

        return {"": s_curve()}
    if config.map.endswith(".npz"):
        from experiments.files.map_files import Lifted, load_map
        from experiments.setups.lifted_runs import curve_number, lifted_course, lifted_curve

        found = load_map(Path(config.map))
        if isinstance(found, Lifted):
            first = found.names[curve_number(found, config.curve)]
            names = [first, *(name for name in found.names if name != first)]
            courses = [lifted_course(lifted_curve(found, name), config) for name in names]
            return {"" if name == first else f"_{name}": course for name, course in zip(names, courses, strict=True)}
    return {"": Trajectory.circle(config.radius, config.lap)}


def certified_sampling(config: RunConfig, delay: float) -> Sampling:
    """The clock of a run, with a delay of the torques [s]."""
    return Sampling(config.scene.servo_period, delay, config.cutoff)


def certificate_inputs(
    config: RunConfig,
    delay: float,
    hands: HandRange,
    push: float,
    clips: Sequence[Clip] = (),
    judging: Judging = JUDGING,
) -> dict[str, object]:
    """All that the verdicts on a run's field depend on, by name, for `hash_of`.

    Parameters
    ----------
    config : RunConfig
        Of the run.
    delay : float
        Of the torques [s].
    hands : HandRange
        Intervals of the hand's impedance.
    push : float
        Largest force of the hand [N].
    clips : sequence of Clip
        Those that are judged besides, and that set the gait of a figure that is led.
    judging : Judging
        By what clips are judged.
    """
    sampling = certified_sampling(config, delay)
    return {
        "gains": certified_laws(config),
        "crossing": (config.crossing, config.reach) if config.mode == "rivers" else None,
        "curve": certified_curves(config),
        "clips": [(clip.name, clip.fps, clip.poses) for clip in clips],
        "judging": judging,
        "figure": (config.scene.stature, config.scene.mass, config.floor_scale) if config.mode == "lead" else None,
        "period": sampling.period,
        "delay": sampling.delay,
        "filter": sampling.cutoff,
        "device": PREMIUM_1_5,
        "hand": hands,
        "push": push,
        "code": _code(),
    }


def clip_inputs(clip: Clip, judging: Judging) -> dict[str, object]:
    """All that the verdicts on a clip depend on, by name, for `hash_of`."""
    return {"clip": (clip.fps, clip.poses), "judging": judging, "code": _code()}


def _code() -> list[object]:
    experiments = Path(__file__).parents[1]
    makers = sorted(path for room in ("certify", "setups") for path in (experiments / room).glob("*.py"))
    return [
        source_hash(),
        [hashlib.sha256(file.read_bytes()).hexdigest() for file in makers],
        [version(library) for library in ("casadi", "numpy", "scipy")],
    ]


def read_certificate(file: Path) -> Certificate:
    """Certificate of a file.

    Raises
    ------
    CertificateError
        If it holds none.
    """
    try:
        return Certificate.from_json(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise CertificateError(f"{file}: cannot be opened ({error.strerror}); expected a certificate.json") from None
    except (ValueError, RecursionError) as error:
        raise CertificateError(f"{file}: {error}") from None


def verify_certificate(file: Path, inputs: Mapping[str, object]) -> Certificate:
    """The certificate of a file, if it is of these inputs: `certificate_inputs` or `clip_inputs`.

    Raises
    ------
    CertificateError
        If the file holds none.
    ChangedInputs
        If any input differs; the message says which.
    """
    certificate = read_certificate(file)
    try:
        certificate.check(inputs)
    except ChangedInputs as error:
        raise ChangedInputs(f"{file}: {error}") from None
    return certificate
