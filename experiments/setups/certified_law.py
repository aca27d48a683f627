"""Laws of force and gains of a run in the form that certificates take, by mode.

Imports nothing but configurations, since certificates import it.
"""

from collections.abc import Callable
from typing import NamedTuple

from controllers.fields.bunny import felt_bunny
from experiments.config.maps import Led, MapFile
from experiments.config.modes import Bunny, Follow, Rivers, Stretch, StretchThenFollow
from experiments.config.run_config import RunConfig
from experiments.setups.parts.defaults import resolved, river_gains, tube_gains


class CertifiedLaw(NamedTuple):
    """A law of force that a run uses, with its gains.

    Attributes
    ----------
    law : str
        Name among `controllers.certificates.loop.laws.LAWS`.
    stiffness, damping : float
        [N/m], [N s/m].
    width : float
        ε or δ [m]; infinite if the law has none.
    """

    law: str
    stiffness: float
    damping: float
    width: float


Laws = dict[str, CertifiedLaw]
"""Laws by the suffix of their verdicts' names; the law of the run's start has the suffix ""."""
_UNBOUNDED = float("inf")


def certified_laws(config: RunConfig) -> Laws:
    """The laws that a run uses."""
    return _LAWS_BY_MODE[config.mode.kind](resolved(config).mode)


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


def _follow_laws(mode: Follow | StretchThenFollow) -> Laws:
    law = "parallel" if isinstance(mode, Follow) and mode.flow == "parallel" else "follow"
    return {"": CertifiedLaw(law, mode.stiffness, mode.damping, mode.tube)}


def _bunny_laws(mode: Bunny) -> Laws:
    """Near a bunny that pulls along the curve, the field is that of FOLLOW to first order."""
    along = mode.bunny_attraction == "along"
    k_r, b_d, width = felt_bunny(mode.stiffness, mode.damping, mode.bunny_width, mode.bunny_attraction)
    return {"": CertifiedLaw("follow" if along else "bunny", k_r, b_d, _UNBOUNDED if along else width)}


def _stretch_laws(mode: Stretch | StretchThenFollow) -> Laws:
    """Tubes seek with the switch open, and hold with it closed."""
    seek, damping = tube_gains(mode)
    return {
        "": CertifiedLaw("seek", seek, damping, _UNBOUNDED),
        "_held": CertifiedLaw("hold", mode.rubber, damping, _UNBOUNDED),
    }


_LAWS_BY_MODE: dict[str, Callable[..., Laws]] = {
    "follow": _follow_laws,
    "bunny": _bunny_laws,
    "rivers": lambda mode: {"": CertifiedLaw("follow", *river_gains(mode), mode.river_tube)},
    "stretch": _stretch_laws,
    # FOLLOW is that on the curve as it was before bending.
    "stretch-then-follow": lambda mode: _stretch_laws(mode) | {"_then": _follow_laws(mode)[""]},
    "lead": lambda mode: {"": CertifiedLaw("leading", mode.leash, mode.damping, _UNBOUNDED)},
}
