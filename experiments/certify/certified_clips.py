"""Clips of a run or of a map file for its certificate, and verdicts on their flights."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from controllers.certificates.flight.tolerance import DEFAULT_CRITERIA, JudgementCriteria
from controllers.certificates.report import FROM_WORST, Verdict
from experiments.config.maps import MapFile
from experiments.config.run_config import RunConfig
from experiments.files.map_files import load_figure_map
from experiments.flights.ballistics import clip_ballistics
from experiments.results.folder import RECORDING, clips_of, config_of, has_animation
from experiments.results.measures.run_measures import SETTLING_TIME
from experiments.setups.setups import clips_for
from models.humanoid.skeleton import DEFAULT_STATURE
from models.mocap.motion.clip import Clip
from sim.recording.recording import Recording

PLAYED = "as played"
_PACE_ASSUMPTION = "clips are judged at their recorded speed, a run at its played speed without the first second"
_FPS = 125.0  # frame rate at which a played animation is judged [1/s]
_MAX_DURATION = 120.0  # longest part of it that is judged [s]


def run_and_clips(folder: Path | None, config: RunConfig) -> tuple[RunConfig, tuple[Clip, ...]]:
    """Configuration and clips of a recorded run; the last clip is its animation as it was played.

    Without a recording: the given configuration, and the clips of its map file or those that it names.
    The animation of a figure of another stature is converted to the default figure, as the clips are.

    Raises
    ------
    ModelError, SimError, OSError
        If there is no such recording, map or clip.
    """
    if folder is not None:
        with Recording(folder / RECORDING) as recording:
            config = config_of(recording)
            size = config.figure.stature / DEFAULT_STATURE
            played_clips = (clip.resized(1.0 / size) for clip in played(recording))
            return config, (*clips_of(recording), *played_clips)
    if isinstance(config.map, MapFile):
        return config, load_figure_map(Path(config.map.file))[1]
    return config, clips_for(config.map)[0]


def similar(clip: Clip, size: float) -> Clip:
    """The default figure's motion that is dynamically similar to a clip on a figure of size s (equal Froude number).

    A figure with lengths s times as long accelerates s times as much, as the clip does when played √s times as fast.
    """
    return clip if size == 1.0 else replace(clip, fps=clip.fps * size**0.5)


def played(recording: Recording) -> tuple[Clip, ...]:
    """The animation of a recorded run as it was played, after the first second; empty if nothing was animated."""
    if not has_animation(recording):
        return ()
    rate = recording.rates["frames"]
    stride, first, last = max(1, round(rate / _FPS)), round(SETTLING_TIME * rate), round(_MAX_DURATION * rate)
    poses = recording.channel("frames", "reference")[first:last:stride]
    return (Clip(poses, rate / stride, PLAYED),) if len(poses) > 1 else ()


def certify_clips(
    clips: Sequence[Clip], criteria: JudgementCriteria = DEFAULT_CRITERIA, size: float = 1.0
) -> dict[str, Verdict]:
    """Verdicts ``ballistic`` and ``turns`` on several clips: the worst of each kind, with a list of all clips.

    `size`: lengths of the figure relative to the default one, for which the clips are made [1].
    """
    found = [(clip.name, clip_ballistics(similar(clip, size), criteria).certificate.verdicts) for clip in clips]
    verdicts: dict[str, Verdict] = {}
    for kind in ("ballistic", "turns"):
        name, worst = min(
            ((name, by_kind[kind]) for name, by_kind in found), key=lambda pair: FROM_WORST.index(pair[1].verdict)
        )
        outcomes = {name: by_kind[kind].verdict for name, by_kind in found}
        listed = ", ".join(f"{clip} {outcome}" for clip, outcome in outcomes.items())
        figure_text = "" if size == 1.0 else f" by a figure of {size * DEFAULT_STATURE:g} m, times over {size**0.5:.2f}"
        reason = f"{name}{figure_text}: {worst.reason}" + (f"; each: {listed}" if len(outcomes) > 1 else "")
        assumptions = (
            (*worst.assumptions, _PACE_ASSUMPTION) if PLAYED not in outcomes or len(outcomes) > 1 else worst.assumptions
        )
        verdicts[kind] = replace(
            worst, reason=reason, assumptions=assumptions, figures={**worst.figures, "clips": outcomes}
        )
    return verdicts
