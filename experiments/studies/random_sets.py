"""Blends of captures drawn by lot: how feet, joints and the physical figure hold while a hand pushes.

``python -m experiments.studies.random_sets FOLDER --half tuning|judging --sets 40 --processes 4 --out OUT`` prepares
the files, says which cannot be blended and why, draws sets of four of the others, runs each for 20 s with pushes, and
prints the table of `docs/validation/blended-motions.md`; ``--files NAME...`` draws of these in the folder instead.
Rows are written as they come, one JSON object a line.
"""

import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

import numpy as np
import tyro

from controllers.haptic_map.lifting.room import Room
from experiments.config.options import run_config
from experiments.files.map_files import save_map
from experiments.fitting.blendable import not_blendable
from experiments.fitting.motion_faults import motion_faults
from experiments.fitting.suitable_laps import best_lap, closed_loops, off_pace, timing_clip
from experiments.lifting.lift import lift_clips
from experiments.preparation.prepared_clip import prepared_clips
from experiments.preparation.tracking_trial import followed
from experiments.setups.wiring import wire
from experiments.trials.trial.measures import TrialLog
from geometry.arrays import Array, rms
from models.errors import ModelError
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import MAX_LIMIT_EXCESS
from sim.body.falls import UP

TUNING = (
    "cmu_amc/02_01.amc", "cmu_amc/02_03.amc", "deepmimic/humanoid3d_backflip.txt", "deepmimic/humanoid3d_dance_a.txt",
    "deepmimic/humanoid3d_jump.txt", "deepmimic/humanoid3d_run.txt", "deepmimic/humanoid3d_spinkick.txt",
    "deepmimic/humanoid3d_walk.txt", "snu/backflip.bvh", "snu/dance.bvh", "snu/kick.bvh", "snu/run.bvh", "snu/walk.bvh",
    "xia/angry_13_000.bvh", "xia/strutting_01_000.bvh", "animated_drawings/jumping.bvh", "cmu_amc/02_04.amc",
)  # fmt: skip
JUDGING = (
    "cmu_amc/16_09.amc", "deepmimic/humanoid3d_cartwheel.txt", "deepmimic/humanoid3d_dance_b.txt",
    "deepmimic/humanoid3d_kick.txt", "deepmimic/humanoid3d_spin.txt", "snu/cart.bvh", "snu/pirouette.bvh",
    "xia/dme_example.bvh", "animated_drawings/wave_hello.bvh", "cmu_amc/01_01.bvh", "cmu_bvh/scaled_131_03.bvh",
)  # fmt: skip
"""The two halves of the captures of `docs/validation/prepared-captures.md`, without one that is a copy."""

RUN_SECONDS = 20.0  # [s] of a run
MAX_SOLO_RESIDUAL = 0.15  # [body weights] RMS residual of a clip followed alone, above which it is not well-formed
_STRIDE = 5  # every fifth frame of the animation is measured: 100 a second


class Captured(NamedTuple):
    """A prepared file, and whether it can be part of a set.

    Attributes
    ----------
    name : str
    reason : str
        Why it is not blended; empty if it is.
    alone : float
        Residual of the figure that follows it alone [body weights].
    fell : float or None
        Time at which the figure then fell [s].
    """

    name: str
    reason: str
    alone: float
    fell: float | None


def captured(folder: str, name: str) -> tuple[Captured, Clip | None]:
    """Prepare a file and follow it alone."""
    try:
        clip = replace(prepared_clips([Path(folder) / name])[0].clip, name=name)
    except ModelError as error:
        return Captured(name, f"refused: {error}", np.inf, None), None
    residual, fell, _ = followed(clip)
    # Against a clip at rest is tested whether a clip can be blended at all.
    reason = "; ".join(not_blendable((clip, Clip(np.repeat(clip.poses[:1], 2, axis=0), clip.fps, "rest"))))
    if not reason and (fell is not None or residual > MAX_SOLO_RESIDUAL):
        fault = f"has a residual of {100 * residual:.0f} %" if fell is None else f"falls at {fell:.1f} s"
        reason = f"alone {fault}"
    return Captured(name, reason, residual, fell), clip


def run_set(number: int, kind: str, clips: Sequence[Clip], seed: int, user: str, folder: str) -> dict[str, Any]:
    """Run a set on a map of a kind at the lap that suits it best, and measure animation and figure.

    On a lifted map the hand follows the curve of the first
    clip, at that clip's pace.
    """
    began = time.process_time()
    loops = closed_loops(clips)
    timing = None if kind == "rivers" else 0 if kind == "composite" else timing_clip(clips)
    names = tuple(clip.name for clip in clips)
    mode = "rivers" if kind == "rivers" else "follow"
    with TemporaryDirectory() as scratch:
        if kind == "lifted":
            file = Path(scratch) / "map.npz"
            save_map(lift_clips([str(Path(folder) / name) for name in names], Room(), seed=seed).haptic_map, file)
            lap, words = clips[0].duration, dict[str, Any](map=str(file))
        else:
            lap = best_lap(clips, timing)
            words = dict[str, Any](map=kind, clips=names, lap=lap)
        config = run_config(mode=mode, user=user, seconds=RUN_SECONDS, seed=seed, **words)
        session = wire(config, tuple(clips))
    played, laps = getattr(session.haptic_map, "loops", loops), getattr(session.haptic_map, "laps", 1)
    log = TrialLog(session.servo, session.world)
    session.loop(log).run(RUN_SECONDS)
    frames, weight = log.frames, session.weight
    fallen = np.flatnonzero(frames["down"] != UP)
    fell = float(frames["t"][fallen[0]]) if len(fallen) else None
    stands = (frames["flight"] == 0.0) & (frames["down"] == UP)
    force = np.linalg.norm(frames["residual"][:, :3], axis=1)[stands] / weight
    rate = 1.0 / float(np.diff(frames["t"]).mean())
    return {
        "set": number, "map": kind, "clips": names, "seed": seed, "lap": lap, "laps": laps,
        "pace": [1.0 if kind == "lifted" else round(one.duration / (laps * lap), 2) for one in played],
        "legs": getattr(session.parts.maps.haptic_map, "legs_of", 0),
        "share": getattr(session.parts.maps.haptic_map, "share", None),
        "remarks": session.remarks, "fell": fell,
        "off_pace": () if kind == "lifted" else off_pace(clips, played, lap, laps, timing),
        "residual": rms(force), "peak": float(force.max()),
        "flight": float(np.mean(frames["flight"] > 0.0)),
        "held": float(np.mean(log.ticks["river"] >= 0.0)) if kind == "rivers" else None,
        "worst": [round(100 * rms(part)) for part in np.array_split(force, 10)],
        **animation_measures(frames["reference"][::_STRIDE], rate / _STRIDE), "cpu": time.process_time() - began,
    }  # fmt: skip


def animation_measures(poses: Array, fps: float) -> dict[str, float]:
    """Lowest sole [cm], foot skate in a stance (95 %, largest) [cm], and joints beyond limits [°] of the animation."""
    motion = motion_faults(poses, fps)
    excess = float(beyond_ranges(poses).max()) - MAX_LIMIT_EXCESS
    return {
        "lowest": 100 * motion.lowest, "skate": 100 * motion.skate, "slid": 100 * motion.furthest,
        "beyond": float(np.rad2deg(max(excess, 0.0))),
    }  # fmt: skip


def drawn(clips: Sequence[Clip], size: int, seed: int) -> Any:
    """Random sets of different clips, without end."""
    rng = np.random.default_rng(seed)
    while True:
        yield tuple(clips[i] for i in rng.choice(len(clips), size=min(size, len(clips)), replace=False))


def summary(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Lines of the table, one per map: sets that stand, with Wilson's interval (1927), and that keep other bounds."""
    from statsmodels.stats.proportion import proportion_confint

    lines = [
        "| map | sets, of which told off their pace before | stand (95 % interval) | residual of those %: median, "
        "largest; within 12 | lowest sole cm; above -1 | skate cm: median, most; within 2 | joints beyond °; within "
        "| time in which a river is active %: least |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind in dict.fromkeys(row["map"] for row in rows):
        of = [row for row in rows if row["map"] == kind]
        held = f"{min(row['held'] for row in of):.0%}" if kind == "rivers" else "–"
        upright = [row for row in of if row["fell"] is None]
        low, high = proportion_confint(len(upright), len(of), method="wilson")
        residual = 100 * np.array([row["residual"] for row in upright] or [np.nan])
        lowest, skate, beyond = (np.array([row[key] for row in of]) for key in ("lowest", "skate", "beyond"))
        lines.append(
            f"| {kind} | {len(of)}, {sum(bool(row['off_pace']) for row in of)} "
            f"| {len(upright)}, {low:.0%} to {high:.0%} "
            f"| {np.median(residual):.1f}, {residual.max():.1f}; {np.sum(residual <= 12.0)} "
            f"| {lowest.min():.1f}; {np.sum(lowest > -1.0)} "
            f"| {np.median(skate):.1f}, {skate.max():.1f}; {np.sum(skate <= 2.0)} "
            f"| {beyond.max():.1f}; {np.sum(beyond == 0.0)} | {held} |"
        )
    return lines


MapKind = Literal["cylindrical", "composite", "rivers", "lifted"]
SIZES: dict[MapKind, int] = {"cylindrical": 4, "composite": 3, "rivers": 3, "lifted": 4}


def main(  # noqa: PLR0913 - the options of the command line
    folder: tyro.conf.Positional[str], out: Path, half: Literal["tuning", "judging"] = "tuning",
    files: tuple[str, ...] = (), sets: int = 10, maps: tuple[MapKind, ...] = ("cylindrical",), seed: int = 1,
    processes: int = 1, user: str = "push",
) -> None:  # fmt: skip
    """Print the table; `files` in the folder are taken in place of a half."""
    files = files or (TUNING if half == "tuning" else JUDGING)
    clips: list[Clip] = []
    with ProcessPoolExecutor(processes) as pool, out.open("w") as written:
        for found, clip in pool.map(captured, [folder] * len(files), files):
            print(f"{found.name}: {found.reason or 'drawn'} (alone {100 * found.alone:.1f} %)", flush=True)
            if clip is not None and not found.reason:
                clips.append(clip)
        rows: list[dict[str, Any]] = []
        tasks = [
            pool.submit(run_set, k, kind, chosen, seed + k, user, folder)
            for k, each in enumerate(islice(zip(*(drawn(clips, SIZES[m], seed) for m in maps), strict=True), sets))
            for kind, chosen in zip(maps, each, strict=True)
        ]
        for task in as_completed(tasks):
            row = task.result()
            rows.append(row)
            written.write(json.dumps(row) + "\n")
            written.flush()
            print(row["set"], row["map"], row["fell"], round(100 * row["residual"], 1), row["clips"], flush=True)
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    tyro.cli(main)
