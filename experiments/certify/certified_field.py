"""Inputs of a certificate, whose hash identifies it: laws, gains, curves, clock, device, hands, clips and code.

A check must be fast, so nothing here imports CasADi or splines at the top. The inputs contain curves as the map has
them, not as the field leads along them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA, JudgementCriteria
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.sampling import Sampling
from controllers.curves.trajectory import Trajectory
from experiments.config.maps import Composite, Cylindrical, Led, MapFile, RiverClips, RobotArm
from experiments.config.modes import Lead, Rivers
from experiments.config.part import to_dict
from experiments.config.run_config import RunConfig, phantom_of
from experiments.files.certificate_files import code_inputs
from experiments.files.device_files import linkage_of
from experiments.setups.certified_law import certified_laws, governor_drag, leading_gains, uncertified_parts
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.lap import circle_of
from models.mocap.motion.clip import Clip
from models.phantom.parameters import PREMIUM_1_5

_Retiming = Callable[[Trajectory], Trajectory]
"""Maps a curve to the curve along which a field leads."""


def certified_curves(config: RunConfig) -> dict[str, Trajectory]:
    """Curves along which a run leads: under "" that of its start, under "_NAME" the other curves of a lifted map.

    Raises
    ------
    ParameterError, SimError, OSError
        If the map has no such curve, the Phantom does not reach it, or there is no such map.
    """
    from experiments.setups.parts.pace import course_of

    stiffness, drag = leading_gains(config)
    return MAP_CURVES[config.map.kind](config.map, partial(course_of, drag=drag, stiffness=stiffness))


def given_curves(config: RunConfig) -> dict[str, Trajectory]:
    """The curves of `certified_curves` as the map has them; with gains and device they determine those.

    Raises
    ------
    ParameterError, SimError, OSError
        If the map has no such curve, the Phantom does not reach a lifted one, or there is no such map.
    """
    return MAP_CURVES[config.map.kind](config.map, lambda curve: curve)


def _lead_curve(part: Led, retime: _Retiming) -> dict[str, Trajectory]:
    # Imported late: loads splines, which a check of gains does not need.
    from experiments.setups.parts.leading_hand import s_curve

    return {"": s_curve()}


def _circle(part: Cylindrical | Composite | RiverClips, retime: _Retiming) -> dict[str, Trajectory]:
    return {"": retime(circle_of(part))}


def _tilted_circle(part: RobotArm, retime: _Retiming) -> dict[str, Trajectory]:
    from experiments.setups.maps.robot_arm import tilted

    return {"": retime(tilted(circle_of(part)))}


def _curves_of_file(part: MapFile, retime: _Retiming) -> dict[str, Trajectory]:
    from experiments.files.map_files import load_map
    from experiments.setups.modes.lifted_runs import curve_number, lifted_curve

    found = load_map(Path(part.file))
    first = found.names[curve_number(found, part.curve)]
    names = [first, *(name for name in found.names if name != first)]
    return {"" if name == first else f"_{name}": retime(lifted_curve(found, name)) for name in names}


MAP_CURVES: dict[str, Callable[[Any, _Retiming], dict[str, Trajectory]]] = {
    "cylindrical": _circle, "composite": _circle, "rivers": _circle, "file": _curves_of_file, "led": _lead_curve,
    "robot-arm": _tilted_circle,
}  # fmt: skip
"""Functions that give the curves of a run, by kind of map."""


def certified_sampling(config: RunConfig, delay: float) -> Sampling:
    """Sampling of a run: servo period, delay of the torques [s] and cut-off of the velocity filter."""
    return Sampling(config.clock.servo_period, delay, phantom_of(config.device).cutoff)


def certified_options(config: RunConfig, delay: float, hands: HandRange, push: float) -> dict[str, object]:
    """The options on which a certificate depends, by name, to report those that differ from a run's.

    Parameters
    ----------
    config, delay, hands, push
        As in `certificate_inputs`.
    """
    found = linkage_of(config.device)
    options: dict[str, object] = {"coulomb": found.coulomb, "viscous": found.viscous, "inertia": found.inertia}
    for part in (config.mode, config.map, config.device, config.clock):
        options |= _flatten(to_dict(part))
    for unused in ("kind", "device_file", "physics_step"):
        del options[unused]
    chosen = {"mode": config.mode.kind, "map": config.map.kind, "delay": delay, "hand_push": push}
    return options | chosen | {f"hand_{name}": value for name, value in asdict(hands).items()}


def _flatten(values: Mapping[str, object]) -> dict[str, object]:
    leaves: dict[str, object] = {}
    for name, value in values.items():
        leaves |= _flatten(cast(Mapping[str, object], value)) if isinstance(value, Mapping) else {name: value}
    return leaves


def certificate_inputs(
    config: RunConfig, delay: float, hands: HandRange, push: float, clips: Sequence[Clip] = (),
    criteria: JudgementCriteria = DEFAULT_CRITERIA,
) -> dict[str, object]:  # fmt: skip
    """All data on which the verdicts on a run's field depend, by name, for `hash_of`.

    Parameters
    ----------
    config : RunConfig
        Configuration of the run.
    delay : float
        Delay of the torques [s].
    hands : HandRange
        Intervals of the hand's impedance.
    push : float
        Largest force of the hand [N].
    clips : sequence of Clip
        Clips that are also judged; for a led figure, the clip that defines its gait.
    criteria : JudgementCriteria
        Tolerances by which clips are judged.
    """
    sampling, mode = certified_sampling(config, delay), config.mode
    return {
        # All parameters of all laws, including those that no certificate covers.
        "gains": (certified_laws(config), resolved(config).mode),
        "added": config.map if uncertified_parts(config) or governor_drag(config) else None,
        "crossing": (mode.crossing, getattr(config.map, "reach", None)) if isinstance(mode, Rivers) else None,
        "curve": given_curves(config),
        "clips": [(clip.name, clip.fps, clip.poses) for clip in clips],
        "judging": (criteria, config.figure.stature),
        "figure": (config.figure.stature, config.figure.mass, mode.floor_scale) if isinstance(mode, Lead) else None,
        "period": sampling.period,
        "delay": sampling.delay,
        "filter": sampling.cutoff,
        # The encoders' offsets change with every calibration and affect no verdict.
        "device": (PREMIUM_1_5, replace(linkage_of(config.device), offset=(0.0, 0.0, 0.0))),
        "hand": hands,
        "push": push,
        "code": code_inputs(),
    }
