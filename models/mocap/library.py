"""Loading of clips: `load_clip` for files of any format, `embedded` for clips of the package; conversion to BVH."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple, TypeAlias

from models.errors import ModelError
from models.mocap.dynamics.contacts import contacts
from models.mocap.motion.clip import Clip
from models.mocap.readers.formats import BVH, WRITABLE, read_motion
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.own_bvh import own_clip, write_bvh
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.bodies import people_hips
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.retarget import retarget
from models.mocap.retargeting.retarget_report import RetargetReport, copy_remarks, floor_remarks, shape_remarks
from models.mocap.retargeting.role_file import stated_roles
from models.mocap.retargeting.roles_by_shape import roles_by_shape
from models.mocap.retargeting.skeleton_roles import Roles, roles_of

Writer: TypeAlias = Callable[[Clip, Path], None]
_CLIPS_FOLDER = files("models.mocap") / "clips"


class Loaded(NamedTuple):
    """A clip from a file.

    Attributes
    ----------
    clip : Clip
        The motion on the figure.
    report : RetargetReport or None
        How the file was interpreted; None for a file on the figure's own skeleton.
    loops : bool or None
        Whether the motion is cyclic, if the file states it.
    """

    clip: Clip
    report: RetargetReport | None
    loops: bool | None = None


def embedded_names() -> tuple[str, ...]:
    """Names of the clips that come with the package, sorted."""
    if not _CLIPS_FOLDER.is_dir():
        return ()
    return tuple(
        sorted(entry.name.removesuffix(".bvh") for entry in _CLIPS_FOLDER.iterdir() if entry.name.endswith(".bvh"))
    )


def embedded(name: str) -> Clip:
    """A clip that comes with the package.

    Raises
    ------
    ModelError
        If there is no clip of that name.
    """
    if name not in embedded_names():
        raise ModelError(f"no embedded clip {name!r}; there are {', '.join(embedded_names())}")
    return replace(_read_embedded(name))


@lru_cache
def _read_embedded(name: str) -> Clip:
    with as_file(_CLIPS_FOLDER / f"{name}.bvh") as path:
        return load_clip(path)


def load_clip(path: Path) -> Clip:
    """The motion in a file, on the figure; see `load`."""
    return load(path).clip


def load(path: Path, hints: Hints | None = None) -> Loaded:
    """The motion in a file, on the figure, and a report: unchanged from a file of `write_bvh`, otherwise retargeted.

    Parameters
    ----------
    path : Path
        File in one of the readable `formats`.
    hints : Hints or None
        Facts about the file that the user states in place of estimates.

    Raises
    ------
    MotionFileError
        If the file cannot be read, its skeleton is not a human's, it has several people of whom none is chosen, or it
        is on the figure's own skeleton and `hints` states more than the frame rate.
    """
    hints, motion = hints or Hints(), read_motion(path)
    if hints.frame_rate is not None:
        motion = replace(motion, fps=hints.frame_rate, timed=True)
    if (clip := own_clip(motion)) is not None:
        if estimated := hints.of_estimates():
            what = f"it is on the figure's own skeleton, whatever {' and '.join(estimated)} would state"
            raise MotionFileError(path, 0, what, f"no {' or '.join(estimated)}")
        return Loaded(clip, None)
    people = people_hips(motion)
    if hints.roles is not None:
        motion, roles = stated_roles(hints.roles, motion, people)
    else:
        _check_single_person(motion, people)
        roles = roles_of(motion.joints, motion.parents, still=motion.still_joints)
    by_shape = isinstance(roles, str)
    if isinstance(roles, str):
        roles = _roles_by_shape(motion, hints, roles)
    clip, report = retarget(motion, roles, hints)
    copies = [joint for own in people if len(own) > 1 for joint in own] if hints.roles is None else []
    remarks = (
        *motion.remarks,
        *copy_remarks([motion.joints[joint] for joint in copies], report.taken["pelvis"]),
        *(shape_remarks(report.taken) if by_shape else ()),
        *report.remarks,
        *floor_remarks(contacts(clip).clearance, clip.poses[:, :3], clip.fps, report.dropped),
    )
    return Loaded(clip, report._replace(remarks=remarks), motion.loops)


def _roles_by_shape(motion: SourceMotion, hints: Hints, missing: str) -> Roles:
    """The roles of joints by the shape of the body, or an error that says for which part no name was found."""
    roles = roles_by_shape(motion, hints.up)
    if isinstance(roles, str):
        names = ", ".join(motion.joints[:8]) + (", …" if len(motion.joints) > 8 else "")
        expected = f"the skeleton of a human, by names or by shape ({roles}), or --roles FILE that assigns its joints"
        raise MotionFileError(motion.path, 1, f"no joint was found for the {missing} (among {names})", expected)
    return roles


def _check_single_person(motion: SourceMotion, people: Sequence[Sequence[int]]) -> None:
    """Raise if there are several people in a file."""
    if len(people) < 2:
        return
    hips = [motion.joints[copies[0]] for copies in people]
    expected = f'one, or --roles FILE whose line pelvis = "{hips[-1]}" selects the person'
    if len(set(hips)) < len(hips):
        expected = "one, or joints of other names for each, so that --roles can tell them apart"
    raise MotionFileError(motion.path, 1, f"there are {len(people)} people, with the hips {', '.join(hips)}", expected)


def check_target(target: Path, overwrite: bool, ends: Sequence[str] = (BVH.suffix,)) -> None:
    """Check that a motion may be written to a file.

    Raises
    ------
    ModelError
        If its name has none of the `ends`, its folder cannot be written into, or it exists and is not to be
        overwritten.
    """
    if target.suffix.lower() not in ends:
        formats = " and ".join(kind.name for kind in WRITABLE if kind.suffix in ends)
        raise ModelError(
            f"cannot write {target}: only {formats} can be written; expected a name that ends in {', '.join(ends)}"
        )
    if target.exists() and not overwrite:
        raise ModelError(f"{target} exists and is left as it is; expected a new name, or --overwrite")
    try:
        TemporaryFile(dir=target.parent).close()
    except OSError as error:
        raise ModelError(f"cannot write {target}: {error.strerror}; expected a writable path") from None


@contextmanager
def writing(target: Path) -> Generator[None]:
    """Context in which an OSError becomes a ModelError that names the file and the reason.

    Raises
    ------
    ModelError
        In place of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise ModelError(
            f"cannot write {error.filename or target}: {error.strerror}; expected a writable path"
        ) from None


def convert(
    source: Path,
    target: Path,
    overwrite: bool = False,
    hints: Hints | None = None,
    writers: Mapping[str, Writer] | None = None,
) -> Loaded:
    """Read any motion file and write it on the figure's 57 channels: retargeted and put on the floor, not prepared.

    Parameters
    ----------
    source, target : Path
        Files.
    overwrite : bool
        Replace the target if it exists.
    hints : Hints, optional
        Facts about the source that the user states.
    writers : mapping, optional
        Writers by file suffix; by default BVH.

    Raises
    ------
    MotionFileError
        If the source cannot be read.
    ModelError
        If no writer has the target's suffix, or the target cannot be written or exists and is not to be overwritten.
    """
    writers = writers or {BVH.suffix: write_bvh}
    check_target(target, overwrite, tuple(writers))
    loaded = load(source, hints)
    with writing(target):
        writers[target.suffix.lower()](loaded.clip, target)
    return loaded
