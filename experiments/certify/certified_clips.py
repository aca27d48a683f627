"""What a run or a map's file brings to its certificate besides gains: its clips, and the verdicts on their flights."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from controllers.certificates.flight.tolerance import JUDGING, Judging
from controllers.certificates.report import Verdict
from experiments.config.maps import MapFile
from experiments.config.run_config import RunConfig
from experiments.files.map_files import load_figure_map
from experiments.flights.ballistics import clip_ballistics
from experiments.results.folder import RECORDING, clips_of, config_of
from experiments.setups.clips import load_clips
from models.mocap.clip import Clip
from sim.recording.recording import Recording

_ORDER = ("refuted", "unknown", "certified")


def run_and_clips(folder: Path | None, config: RunConfig) -> tuple[RunConfig, tuple[Clip, ...]]:
    """Configuration and clips of a recorded run; else this configuration, and the clips of its map's file or led.

    Raises
    ------
    ModelError, SimError, OSError
        If there is no such recording, map or clip.
    """
    if folder is not None:
        with Recording(folder / RECORDING) as recording:
            return config_of(recording), clips_of(recording)
    if isinstance(config.map, MapFile):
        return config, load_figure_map(Path(config.map.file))[1]
    return config, load_clips(config.map.clips, config.map.raw)[0]


def certify_clips(clips: Sequence[Clip], judging: Judging = JUDGING) -> dict[str, Verdict]:
    """Verdicts ``ballistic`` and ``turns`` on clips together: the worst of them, which is named, and all in figures."""
    found = [(clip.name, clip_ballistics(clip, judging).certificate.verdicts) for clip in clips]
    told: dict[str, Verdict] = {}
    for kind in ("ballistic", "turns"):
        name, worst = min(((name, of[kind]) for name, of in found), key=lambda pair: _ORDER.index(pair[1].verdict))
        each = {name: of[kind].verdict for name, of in found}
        told[kind] = replace(worst, reason=f"{name}: {worst.reason}", figures={**worst.figures, "clips": each})
    return told
