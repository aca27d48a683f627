"""Joint roles that the user states, in a TOML file of lines such as ``left_thigh = "Bone.012"``."""

import tomllib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from models.humanoid.skeleton import BODIES
from models.mocap.readers.motion_file import MotionFileError, quoted, read_text
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.bodies import extract_body
from models.mocap.retargeting.skeleton_roles import LIMBS, Roles, ancestry, assembled, names_of, roles_of

_ROLES = (*BODIES, *(f"{side}_{end}" for side in ("left", "right") for end in ("wrist", "toe")))
_SIZE_LIMIT = 100_000  # bytes
_REQUIRED_ROLES = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shank"))


def stated_roles(path: Path, motion: SourceMotion, people: Sequence[Sequence[int]]) -> tuple[SourceMotion, Roles]:
    """The roles in a file, for the joints of a motion, and the motion of the body to which they belong.

    Roles are the figure's bodies, and the ends of forearms and feet: ``left_wrist`` (if the hand is another joint
    beyond it) and ``left_toe``. Thighs and shanks are required. Pelvis, abdomen, chest and head, if left out, are found
    as without a file; other roles that are left out have no joint. A file with the pelvis alone selects a person: all
    other joints are found by their names.

    Parameters
    ----------
    path : Path
        TOML file.
    motion : SourceMotion
        The motion of one or more people.
    people : sequence of sequences of int
        Their hips, from `bodies`.

    Raises
    ------
    MotionFileError
        If the file cannot be read, a role or a joint is unknown, two roles have the same joint, a thigh or a shank is
        missing, or a part of a limb is above the one before it.
    """
    stated = _read_toml(path)
    whole = _joints_of_roles(path, stated, motion)
    if not (pelvis_only := set(whole) == {"pelvis"}) and (
        missing := [role for role in _REQUIRED_ROLES if role not in whole]
    ):
        raise MotionFileError(path, 0, f"no joint for {', '.join(missing)}", f'{missing[0]} = "NAME OF A JOINT"')
    hips = [joint for copies in people for joint in (copies if pelvis_only else copies[:1])]
    motion = extract_body(motion, hips, next(iter(whole.values()))) if len(hips) > 1 else motion
    named = _joints_of_roles(path, stated, motion)
    if pelvis_only:
        roles = roles_of(motion.joints, motion.parents, named["pelvis"], motion.still_joints)
    else:
        _check_order(path, named, motion)
        roles = assembled(named, names_of(motion.joints), motion.parents)
    if isinstance(roles, str):
        raise MotionFileError(path, 0, f"no joint was found for the {roles}", "the skeleton of a human")
    return motion, roles


def _joints_of_roles(path: Path, stated: dict[str, object], motion: SourceMotion) -> dict[str, int]:
    """Joint of every role."""
    named: dict[str, int] = {}
    listed = ", ".join(motion.joints[:40]) + (", …" if len(motion.joints) > 40 else "")
    for role, joint in stated.items():
        if role not in _ROLES:
            raise MotionFileError(path, 0, f"no role {quoted(role)}", f"one of {', '.join(_ROLES)}")
        indices = [k for k, name in enumerate(motion.joints) if name == joint]
        if not isinstance(joint, str) or len(indices) != 1:
            what = f"{len(indices) or 'no'} joint{'s' * (len(indices) > 1)} of {motion.path.name} called {joint!r}"
            raise MotionFileError(path, 0, f"{role}: {what}", f"one of {listed}")
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


def _read_toml(path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(read_text(path, _SIZE_LIMIT, "role file").decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise MotionFileError(path, 0, f"is no TOML ({error})", 'lines such as left_thigh = "NAME"') from None
