"""Laws of force and gains of a run in the form that certificates take, by mode.

Imports nothing but configurations, since certificates import it.
"""

from typing import NamedTuple

from controllers.fields.bunny import felt_bunny
from experiments.config.maps import Led, MapFile
from experiments.config.modes import Bunny, Follow, Lead, Rivers, StretchThenFollow, StretchyTube
from experiments.config.run_config import RunConfig
from experiments.setups.parts.defaults import resolved, river_gains, tube_gains


class CertifiedLaw(NamedTuple):
    """A law of force, by its name in `laws.LAWS`, with its k_r [N/m], b_d [N s/m], and ε or δ [m], else infinite."""

    law: str
    stiffness: float
    damping: float
    width: float


Laws = dict[str, CertifiedLaw]
"""Laws by the suffix of their verdicts' names; the law of the run's start has the suffix ""."""
_UNBOUNDED = float("inf")


def certified_laws(config: RunConfig) -> Laws:
    """The laws that a run uses."""
    mode = resolved(config).mode
    match mode:
        case Follow():
            law = "parallel" if mode.flow == "parallel" else "follow"
            return {"": CertifiedLaw(law, mode.stiffness, mode.damping, mode.tube)}
        case Bunny():  # near one that pulls along the curve, the field is that of FOLLOW to first order
            k_r, b_d, width = felt_bunny(mode.stiffness, mode.damping, mode.bunny_width, mode.bunny_attraction)
            along = mode.bunny_attraction == "along"
            return {"": CertifiedLaw("follow" if along else "bunny", k_r, b_d, _UNBOUNDED if along else width)}
        case Rivers():
            return {"": CertifiedLaw("follow", *river_gains(mode), mode.river_tube)}
        case Lead():
            return {"": CertifiedLaw("leading", mode.leash, mode.damping, _UNBOUNDED)}
        case StretchyTube():  # tubes seek with the switch open, and hold with it closed
            seek, damping = tube_gains(mode)
            laws = {
                "": CertifiedLaw("seek", seek, damping, _UNBOUNDED),
                "_held": CertifiedLaw("hold", mode.rubber, damping, _UNBOUNDED),
            }
            if isinstance(mode, StretchThenFollow):  # on the curve as it was before bending
                laws["_then"] = CertifiedLaw("follow", mode.stiffness, mode.damping, mode.tube)
            return laws


def leading_gains(config: RunConfig) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] for which a run's course is timed; 0 if it does not lead along its curve.

    The stiffness is 0 also with a parallel flow, where a hand that runs outside a bend keeps the curve's pace.
    """
    mode = resolved(config).mode
    if isinstance(mode, Rivers):
        return river_gains(mode)
    if isinstance(mode, Follow) and mode.flow == "parallel":
        return 0.0, mode.damping
    return (mode.stiffness, mode.damping) if isinstance(mode, Follow | StretchThenFollow) else (0.0, 0.0)


def governor_drag(config: RunConfig) -> float:
    """Drag [N s/m] of the governor that is added to a run's law; 0 without one, and where rivers are gated instead."""
    governor = getattr(config.mode, "governor", None)
    return 0.0 if governor is None or isinstance(config.mode, Rivers) else governor.governor_drag


def depends_on_clips(config: RunConfig) -> bool:
    """Whether the certificate depends on clips too: a led figure, a map from a file, a governor, gates or walls."""
    return isinstance(config.map, Led | MapFile) or governor_drag(config) > 0.0 or bool(uncertified_parts(config))


def uncertified_parts(config: RunConfig) -> tuple[str, ...]:
    """Names of the parts of a run that act besides its certified laws, and that no certificate covers."""
    mode = config.mode
    names: list[str] = []
    if getattr(mode, "walls", None) is not None:
        names.append("the soft walls (--walls)")
    if isinstance(mode, Rivers) and mode.governor is not None:
        names.append("the gates of the rivers (--governor)")
    return tuple(names)
