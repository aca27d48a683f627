"""Parsing of joint names into a side and body words, whatever a program writes around them.

``Skeleton_001_LeftUpLeg``, ``l_upleg_JNT``, ``leftupleg`` and ``RL_L_UpLeg`` all become (left, upleg). Leading and
trailing words that half of the joints share belong to the skeleton's name; numbers count a chain or come from an
export.
"""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

_SIDES = {"left": "left", "l": "left", "lt": "left", "lf": "left", "lft": "left",
          "right": "right", "r": "right", "rt": "right", "rf": "right", "rgt": "right"}  # fmt: skip
_CENTRE_WORDS = frozenset(("c", "cn", "m", "x", "mid", "middle", "center", "centre"))
_NOISE_WORDS = frozenset((
    "jnt", "joint", "jt", "j", "bind", "def", "deform", "org", "bn", "bone", "b", "skin", "bend", "stretch", "bip",
    "biped", "mixamorig", "character", "cc", "armature", "rig",
))  # fmt: skip
_HELPER_WORDS = frozenset((
    "twist", "roll", "helper", "corrective", "muscle", "mesh", "nub", "end", "ik", "pole", "ctrl", "target", "site",
    "marker", "tip", "part",
))  # fmt: skip
_TRUNK_WORDS = frozenset(("torso", "pelvis"))
# Least fraction of the joints that share a word of the skeleton's name: 0.25 and 0.9 name 17 captures the same way.
_MIN_SHARED_FRACTION = 0.5
# MikuMikuDance; longer words first.
_JAPANESE = {
    "左": "left", "右": "right", "上半身": "spine", "下半身": "pelvis", "センター": "center", "足首": "ankle",
    "手首": "wrist", "つま先": "toe", "ひざ": "knee", "ひじ": "elbow", "足": "leg", "腕": "arm", "肩": "shoulder",
    "首": "neck", "頭": "head",
}  # fmt: skip
_GLOSS = re.compile(r"[\[(].*?[\])]")  # Skyrim's NPC L Thigh [LThg]
_PIECES = re.compile(r"[\W_]+")
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|[^\W\da-zA-Z_]+")


class JointName(NamedTuple):
    """A parsed joint name.

    Attributes
    ----------
    side : str
        ``left``, ``right``, or empty.
    bare : str
        The other words in lower case, joined: ``upperarm``.
    noisy : bool
        Whether words such as *joint* or *stretch*, leading underscores, or another body are left out of `bare`: among
        joints with the same words, one without them is more likely to be the body's.
    helper : bool
        Whether it is a twist, a tip, or another joint that is not part of the body.
    """

    side: str
    bare: str
    noisy: bool
    helper: bool


def joint_names(joints: tuple[str, ...], sided: frozenset[str], central: frozenset[str]) -> tuple[JointName, ...]:
    """Side and words of every joint's name.

    Parameters
    ----------
    joints : tuple of str
        Names as the file gives them.
    sided, central : frozenset of str
        Words of body parts with a side, and of those without.
    """
    split = [_split_words(joint) for joint in joints]
    for end, matches in ((0, str.startswith), (-1, str.endswith)):
        while (word := _shared_word(split, end)) is not None:
            if len(word) > 1 and any(matches(alias, word) for alias in sided | central):
                break
            rest = slice(1, None) if end == 0 else slice(-1)
            split = [words[rest] if len(words) > 1 and words[end] == word else words for words in split]
    # MakeHuman's __UpLeg_L is the link from the pelvis to UpLeg_L.
    return tuple(
        _parse(words, sided, _without_namespace(joint).startswith("__"))
        for words, joint in zip(split, joints, strict=True)
    )


def _shared_word(split: Sequence[list[str]], end: int) -> str | None:
    """The first or last word of the names (`end` 0 or −1) that belongs to the skeleton's name, if there is one."""
    counts = Counter(words[end] for words in split if len(words) > 1)
    word, n = counts.most_common(1)[0] if counts else ("", 0)
    return None if n < _MIN_SHARED_FRACTION * len(split) or word in _SIDES else word


def _without_namespace(name: str) -> str:
    return name.rsplit(":", 1)[-1]


def _split_words(name: str) -> list[str]:
    """Words of a name in lower case, without namespace and numbers: ``ns:Bip01 L UpperArm`` → bip, l, upper, arm."""
    name = _without_namespace(name)
    name = _GLOSS.sub("", name) or name
    for text, word in _JAPANESE.items():
        name = name.replace(text, f" {word} ")
    words: list[str] = []
    for piece in _PIECES.split(name):
        found = [word for word in _WORDS.findall(piece) if not word.isdecimal()]
        # LFArm is the left forearm (OptiTrack), LF_Arm the left arm.
        if len(found) > 1 and found[0] in ("LF", "RF"):
            found = ["".join(found)]
        words.extend(word.lower() for word in found)
    return words


def _parse(words: list[str], sided: frozenset[str], link: bool) -> JointName:
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    others = [word for word in words if word not in _SIDES]
    if not side and not _CENTRE_WORDS.issuperset(others):
        others = [word for word in others if word not in _CENTRE_WORDS]
    bare = "".join(word for word in others if word not in _NOISE_WORDS)
    # torso_head, lTorso_Clavicle (GAMES-105), left_tibia_foot: a joint between two bodies moves the second one.
    between = bare not in sided and "".join(others[:-1]) in _TRUNK_WORDS | sided and others[-1] in sided | {"head"}
    bare = others[-1] if between else bare
    noisy = link or between or not _NOISE_WORDS.isdisjoint(others)
    helper = not _HELPER_WORDS.isdisjoint(others)
    if not side:
        for mark in _SIDES:
            rest = bare.removeprefix(mark)
            if rest != bare and rest in sided and bare not in sided:
                return JointName(_SIDES[mark], rest, noisy, helper)
    return JointName(side, bare, noisy, helper)
