"""Roles of a skeleton's joints as a person states them, in a TOML file of lines such as ``left_thigh = "Bone.012"``."""

import tomllib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from models.humanoid.skeleton import BODIES
from models.mocap.readers.motion_file import MotionFileError, quoted, read_text
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.bodies import of_one_body
from models.mocap.retargeting.skeleton_roles import LIMBS, Roles, ancestry, assembled, names_of, roles_of

_ROLES = (*BODIES, *(f"{side}_{end}" for side in ("left", "right") for end in ("wrist", "toe")))
_LIMIT = 100_000  # bytes
_NEEDED = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shank"))


def stated_roles(
    path: Path, motion: SourceMotion, people: Sequence[Sequence[int]]
) -> tuple[SourceMotion, Roles]:  # fmt: skip
    """The roles in a file, for the joints of a motion, and the motion of the body that they are of.

    Roles are the figure's bodies, and where forearms and feet end: ``left_wrist`` (if the hand is another joint beyond
    it) and ``left_toe``. Thighs and shanks have to be there. Pelvis, abdomen, chest and head are found as without a
    file where it leaves them out; of the others, those that it leaves out have no joint. A file of the pelvis alone
    says whose body is meant: all its other joints are found by their names.

    Parameters
    ----------
    path : Path
        TOML file.
    motion : SourceMotion
        The motion of one person or more.
    people : sequence of sequences of int
        Their hips, of `bodies`.

    Raises
    ------
    MotionFileError
        If the file cannot be read, a role or a joint is unknown, two roles have one joint, a thigh or a shank is
        missing, or a part of a limb is above the one before it.
    """
    stated = _read(path)
    whole = _named(path, stated, motion)
    if not (alone := set(whole) == {"pelvis"}) and (missing := [role for role in _NEEDED if role not in whole]):
        raise MotionFileError(path, 0, f"no joint for {', '.join(missing)}", f'{missing[0]} = "NAME OF A JOINT"')
    hips = [joint for copies in people for joint in (copies if alone else copies[:1])]
    motion = of_one_body(motion, hips, next(iter(whole.values()))) if len(hips) > 1 else motion
    named = _named(path, stated, motion)
    if alone:
        roles = roles_of(motion.joints, motion.parents, named["pelvis"])
    else:
        _check_order(path, named, motion)
        roles = assembled(named, names_of(motion.joints), motion.parents)
    if isinstance(roles, str):
        raise MotionFileError(path, 0, f"no joint is taken for the {roles}", "the skeleton of a human")
    return motion, roles


def _named(path: Path, stated: dict[str, object], motion: SourceMotion) -> dict[str, int]:
    """Joint of every role."""
    named: dict[str, int] = {}
    for role, joint in stated.items():
        if role not in _ROLES:
            raise MotionFileError(path, 0, f"no role {quoted(role)}", f"one of {', '.join(_ROLES)}")
        indices = [k for k, name in enumerate(motion.joints) if name == joint]
        if not isinstance(joint, str) or len(indices) != 1:
            what = f"{len(indices) or 'no'} joint{'s' * (len(indices) > 1)} of {motion.path.name} called {joint!r}"
            raise MotionFileError(path, 0, f"{role}: {what}", f"one of {_listed(motion.joints)}")
        if other := [known for known, index in named.items() if index == indices[0]]:
            raise MotionFileError(path, 0, f"{joint} is both {other[0]} and {role}", "a joint for one role")
        named[role] = indices[0]
    return named


def _check_order(path: Path, named: dict[str, int], motion: SourceMotion) -> None:
    """Raise if a part of a limb is above the one before it."""
    for side in ("left", "right"):
        for parts in LIMBS:
            chain = [named[f"{side}_{part}"] for part in parts if f"{side}_{part}" in named]
            for upper, lower in pairwise(chain):
                if lower in ancestry(upper, motion.parents):
                    what = f"{motion.joints[lower]} is above {motion.joints[upper]} in the skeleton"
                    raise MotionFileError(path, 0, what, f"{' and then '.join(parts)} on the way from the pelvis out")


def _read(path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(read_text(path, _LIMIT, "role file").decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise MotionFileError(path, 0, f"is no TOML ({error})", 'lines such as left_thigh = "NAME"') from None


def _listed(joints: tuple[str, ...]) -> str:
    """The joints' names, or the first forty."""
    return ", ".join(joints[:40]) + (", …" if len(joints) > 40 else "")
