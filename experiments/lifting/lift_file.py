"""``hvf lift``: makes a haptic map from clips alone, reports its quality, and writes it to a file."""

from collections.abc import Sequence
from pathlib import Path

from controllers.checks import check_kind
from controllers.haptic_map.lifting.room import Room
from experiments.config.maps import MAP_SUFFIX
from experiments.files.given_path import given_path
from experiments.files.map_files import save_map
from experiments.lifting.lift import lift_clips
from experiments.lifting.lift_report import LiftReport, report_lift
from sim.errors import SimError

_DEFAULT_ROOM = Room()


def lift_into(
    names: Sequence[str | Path], out: str | Path, *, room: Room = _DEFAULT_ROOM, cyclic: Sequence[str | Path] = (),
    seed: int = 1, overwrite: bool = False, raw: bool = False,
) -> LiftReport:  # fmt: skip
    """Lift clips: a curve for each, and one haptic map with all of them, which is measured and written to a file.

    Parameters
    ----------
    names : sequence of str or path
        Names of embedded clips, or motion files, which are prepared.
    out : path
        File to write (.npz); it is written last.
    room : Room
        Where the curves may lie.
    cyclic : sequence of str or path
        Those of `names` that must be closed; of the others, clips that close are closed.
    seed : int
        Seed of the initial arrangement of the curves.
    overwrite : bool
        Replace an existing file.
    raw : bool
        Take motion files as captured, not prepared.

    Raises
    ------
    ModelError, ControllerError, SimError
        As `lift_clips`; or if an argument is of the wrong kind, or the file is not a .npz or exists and is not to be
        replaced.
    OSError
        If it cannot be written.
    """
    for name, value, kind in (
        ("names", names, Sequence[str | Path]), ("room", room, Room), ("cyclic", cyclic, Sequence[str | Path]),
        ("seed", seed, int), ("overwrite", overwrite, bool), ("raw", raw, bool),
    ):  # fmt: skip
        check_kind(name, value, kind)
    out, clips = given_path("out", out), tuple(map(str, names))
    if out.suffix != MAP_SUFFIX:
        raise SimError(f"{out}: a map is written into a {MAP_SUFFIX} file; expected a name that ends so")
    if out.exists() and not overwrite:
        raise SimError(f"{out}: exists; choose another --out, or --overwrite it")
    report = report_lift(lift_clips(clips, room, tuple(map(str, cyclic)), seed, raw), seed)
    out.parent.mkdir(parents=True, exist_ok=True)
    save_map(report.lifted.haptic_map, out)
    return report
