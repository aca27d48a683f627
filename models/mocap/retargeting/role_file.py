"""Roles of a skeleton's joints as a person states them, in a TOML file of lines such as ``left_thigh = "Bone.012"``."""

import tomllib
from itertools import pairwise
from pathlib import Path

from models.humanoid.skeleton import BODIES
from models.mocap.readers.motion_file import MotionFileError, quoted, read_text
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.skeleton_roles import LIMBS, Roles, ancestry, assembled, names_of

_ROLES = (*BODIES, *(f"{side}_{end}" for side in ("left", "right") for end in ("wrist", "toe")))
_LIMIT = 100_000  # bytes
_NEEDED = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shank"))


def stated_roles(path: Path, motion: SourceMotion) -> Roles:
    """The roles in a file, for the joints of a motion.

    Roles are the figure's bodies, and where forearms and feet end: ``left_wrist`` (if the hand is another joint beyond
    it) and ``left_toe``. Thighs and shanks have to be there. Pelvis, abdomen, chest and head are found as without a
    file where it leaves them out; of the others, those that it leaves out have no joint.

    Raises
    ------
    MotionFileError
        If the file cannot be read, a role or a joint is unknown, two roles have one joint, a thigh or a shank is
        missing, or a part of a limb is above the one before it.
    """
    named: dict[str, int] = {}
    for role, joint in _read(path).items():
        if role not in _ROLES:
            raise MotionFileError(path, 0, f"no role {quoted(role)}", f"one of {', '.join(_ROLES)}")
        indices = [k for k, name in enumerate(motion.joints) if name == joint]
        if not isinstance(joint, str) or len(indices) != 1:
            what = f"{len(indices) or 'no'} joint{'s' * (len(indices) > 1)} of {motion.path.name} called {joint!r}"
            raise MotionFileError(path, 0, f"{role}: {what}", f"one of {_listed(motion.joints)}")
        if other := [known for known, index in named.items() if index == indices[0]]:
            raise MotionFileError(path, 0, f"{joint} is both {other[0]} and {role}", "a joint for one role")
        named[role] = indices[0]
    if missing := [role for role in _NEEDED if role not in named]:
        raise MotionFileError(path, 0, f"no joint for {', '.join(missing)}", f'{missing[0]} = "NAME OF A JOINT"')
    for side in ("left", "right"):
        for parts in LIMBS:
            chain = [named[f"{side}_{part}"] for part in parts if f"{side}_{part}" in named]
            for upper, lower in pairwise(chain):
                if lower in ancestry(upper, motion.parents):
                    what = f"{motion.joints[lower]} is above {motion.joints[upper]} in the skeleton"
                    raise MotionFileError(path, 0, what, f"{' and then '.join(parts)} on the way from the pelvis out")
    roles = assembled(named, names_of(motion.joints), motion.parents)
    if isinstance(roles, str):
        raise MotionFileError(path, 0, f"no joint is taken for the {roles}", "the skeleton of a human")
    return roles


def _read(path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(read_text(path, _LIMIT).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise MotionFileError(path, 0, f"is no TOML ({error})", 'lines such as left_thigh = "NAME"') from None


def _listed(joints: tuple[str, ...]) -> str:
    """The joints' names, or the first forty."""
    return ", ".join(joints[:40]) + (", …" if len(joints) > 40 else "")
