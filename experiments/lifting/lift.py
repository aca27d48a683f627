"""Lifting of clips by name or file: a curve for each, and one haptic map with all of them."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.lift import Lifting, closes, lift
from controllers.haptic_map.lifting.motion_features import Motion
from controllers.haptic_map.lifting.room import Room
from controllers.haptic_map.lifting.transitions import MapTransition
from controllers.motion.loops import append_reversal, checked_clip
from experiments.fitting.figure_legs import figure_legs
from experiments.lifting.map_quality import N_SAMPLES, Layout, body_weights, lap_times
from experiments.lifting.repeats import gait_strides, repeated
from experiments.setups.parts.clips import load_clips
from models.errors import ModelError
from models.humanoid.skeleton import figure_model
from models.mocap.dynamics.contacts import contacts
from models.mocap.motion.clip import Clip
from models.one_blas_thread import on_one_blas_thread
from sim.errors import SimError
from sim.world.world import phantom_angles


@dataclass(frozen=True, eq=False)
class LiftedClips:
    """A lifted map and the clips of which it was made.

    Attributes
    ----------
    clips : tuple of Clip
        The clips as lifted.
    turned : tuple of bool
        Whether each is followed by its reversal (`append_reversal`).
    rounds : tuple of int
        How often each is repeated in a lap.
    names : tuple of str
        A unique name for each.
    remarks : tuple of str
        Remarks from loading the clips.
    lifting : Lifting
        Curves and measures.
    haptic_map : Lifted
        The map.
    seconds : float
        Time of lifting [s].
    """

    clips: tuple[Clip, ...]
    turned: tuple[bool, ...]
    rounds: tuple[int, ...]
    names: tuple[str, ...]
    remarks: tuple[str, ...]
    lifting: Lifting
    haptic_map: Lifted
    seconds: float

    def layout(self) -> Layout:
        """The places of the clips in the map, for `measure_map`."""
        steps = 2.0 * np.pi * np.arange(N_SAMPLES) / N_SAMPLES
        sites = np.stack([self.haptic_map.site(i, steps) for i in range(len(self.clips))], axis=1)
        times = [lap_times(angles, clip.duration) for angles, clip in zip(self.lifting.angles, self.clips, strict=True)]
        return Layout(self.haptic_map, self.names, sites, np.stack(times, axis=1))


def check_workspace(room: Room) -> None:
    """Check that the Phantom reaches the whole hollow cylinder of a room.

    Raises
    ------
    SimError
        If it does not; the message names the point.
    """
    for z in np.linspace(*room.z_range, 9):
        for angle in np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False):
            for r in room.r_range:
                try:
                    phantom_angles(np.array([r * np.cos(angle), r * np.sin(angle), z]))
                except SimError as error:
                    raise SimError(
                        f"{error}; expected r {room.r_range}, z {room.z_range} m to lie within its reach: a smaller "
                        "--room.r-range or another --room.z-range"
                    ) from None


@on_one_blas_thread
def lift_clips(
    names: Sequence[str], room: Room, cyclic: Sequence[str] = (), seed: int = 1, raw: bool = False
) -> LiftedClips:
    """Lift clips by name or file; an open clip nearly at rest at both ends goes back (`append_reversal`).

    Parameters
    ----------
    names : sequence of str
        Names of embedded clips, or files.
    room : Room
        Where the curves may lie.
    cyclic : sequence of str
        Those of `names` that must be closed; of the others, clips that close are closed.
    seed : int
        Seed of the initial arrangement of the curves.
    raw : bool
        Take motion files as captured, not prepared.

    Raises
    ------
    HvfError
        If a clip cannot be read or lifted, or the Phantom does not reach the room.
    """
    unknown = [name for name in cyclic if name not in names]
    if unknown:
        raise ModelError(f"cyclic names {', '.join(unknown)}; expected some of the clips to lift: {', '.join(names)}")
    if seed < 0:
        raise SimError(f"the seed is {seed}; expected 0 or more")
    check_workspace(room)
    loaded, remarks = load_clips(names, raw)
    begin = time.perf_counter()
    clips = tuple(
        clip if name in cyclic else replace(clip, poses=append_reversal(clip.poses, clip.fps))
        for clip, name in zip(loaded, names, strict=True)
    )
    turned = tuple(clip.n_frames > as_loaded.n_frames for clip, as_loaded in zip(clips, loaded, strict=True))
    clips, rounds = repeated(clips)
    labels = _unique_labels(names)
    motions = [_motion(clip, label, name in cyclic) for clip, label, name in zip(clips, labels, names, strict=True)]
    lifting = lift(motions, body_weights(), room, np.random.default_rng(seed))
    transitions = [MapTransition(at.first, at.second, at.angle, at.pose, at.velocity) for at in lifting.transitions]
    haptic_map = Lifted(
        [(clip.poses, clip.fps) for clip in clips], [motion.closed for motion in motions], lifting.angles,
        lifting.sites, figure_legs(figure_model()), labels, transitions=transitions,
    )  # fmt: skip
    return LiftedClips(clips, turned, rounds, labels, remarks, lifting, haptic_map, time.perf_counter() - begin)


def _unique_labels(names: Sequence[str]) -> tuple[str, ...]:
    """A unique name for every clip: its name or file stem, with a number appended if it is taken."""
    labels: list[str] = []
    for name in names:
        stem = Path(name).stem if Path(name).suffix else name
        count = sum(label == stem or label.rpartition("-")[0] == stem for label in labels)
        labels.append(stem if count == 0 else f"{stem}-{count + 1}")
    return tuple(labels)


def _motion(clip: Clip, name: str, must_close: bool) -> Motion:
    closed = must_close or (clip.n_frames > 1 and closes(checked_clip(clip.poses, clip.fps, name)))
    return Motion(clip.poses, clip.fps, name, closed, contacts(clip).loaded, gait_strides(clip))
