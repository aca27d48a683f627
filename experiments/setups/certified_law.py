"""Laws of force of a run as certificates take them, and how it leads along its curve, by mode.

Light to import, as what certificates are checked by is.
"""

from collections.abc import Callable
from typing import NamedTuple

from controllers.fields.bunny import felt_bunny
from experiments.config.modes import Bunny, Follow, Lead, Rivers, Stretch, StretchThenFollow
from experiments.config.run_config import RunConfig
from experiments.setups.defaults import resolved, river_gains, tube_gains


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


Laws = dict[str, CertifiedLaw]
"""By what is added to the names of their verdicts; that of the run's start by ""."""
_ANY = float("inf")


def certified_laws(config: RunConfig) -> Laws:
    """The laws that a run uses."""
    return _LAWS[config.mode.kind](resolved(config).mode)


def leading_gains(config: RunConfig) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] with which a run leads along its curve; 0 where it does not lead."""
    mode = resolved(config).mode
    if isinstance(mode, Rivers):
        return river_gains(mode)
    return (mode.stiffness, mode.damping) if isinstance(mode, Follow | StretchThenFollow) else (0.0, 0.0)


def governor_drag(config: RunConfig) -> float:
    """Drag [N s/m] of the governor that a run's law is added to; 0 without one, and where rivers are gated instead."""
    governor = getattr(config.mode, "governor", None)
    return 0.0 if governor is None or isinstance(config.mode, Rivers) else governor.governor_drag


def of_clips(config: RunConfig) -> bool:
    """Whether the certificate of a field is of clips, too: a figure that is led, a map's file, a governor or walls."""
    return config.map.kind in ("led", "file") or governor_drag(config) > 0.0 or bool(left_out(config))


def left_out(config: RunConfig) -> tuple[str, ...]:
    """What a run executes besides its certified laws, and no certificate covers; in words."""
    mode = config.mode
    names: list[str] = []
    if getattr(mode, "walls", None) is not None:
        names.append("the soft walls (--walls)")
    if isinstance(mode, Rivers) and mode.governor is not None:
        names.append("the gates of the rivers (--governor)")
    return tuple(names)


def _follow(mode: Follow | StretchThenFollow) -> Laws:
    return {"": CertifiedLaw("follow", mode.stiffness, mode.damping, mode.tube)}


def _bunny(mode: Bunny) -> Laws:
    """Near a bunny that pulls along the curve the field is FOLLOW's, to first order."""
    along = mode.bunny_attraction == "along"
    k_r, b_d, width = felt_bunny(mode.stiffness, mode.damping, mode.bunny_width, mode.bunny_attraction)
    return {"": CertifiedLaw("follow" if along else "bunny", k_r, b_d, _ANY if along else width)}


def _rivers(mode: Rivers) -> Laws:
    return {"": CertifiedLaw("follow", *river_gains(mode), mode.river_tube)}


def _stretch(mode: Stretch | StretchThenFollow) -> Laws:
    """Tubes seek with the switch open, and hold with it closed."""
    seek, damping = tube_gains(mode)
    return {
        "": CertifiedLaw("seek", seek, damping, _ANY),
        "_held": CertifiedLaw("hold", mode.rubber, damping, _ANY),
    }


def _stretch_then_follow(mode: StretchThenFollow) -> Laws:
    """Likewise, and the performance of the curve as it was before it was bent."""
    return _stretch(mode) | {"_then": _follow(mode)[""]}


def _lead(mode: Lead) -> Laws:
    return {"": CertifiedLaw("leading", mode.leash, mode.damping, _ANY)}


_LAWS: dict[str, Callable[..., Laws]] = {
    "follow": _follow, "bunny": _bunny, "rivers": _rivers, "stretch": _stretch,
    "stretch-then-follow": _stretch_then_follow, "lead": _lead,
}  # fmt: skip
