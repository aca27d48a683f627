"""Assignment of a foreign skeleton's joints to the figure's segments, by name and by position in the joint tree.

Known naming schemes: CMU (ASF and both BVH conversions), Mixamo and HumanIK, MotionBuilder, SFU, Biovision, 3ds Max
Biped, Unreal, Xsens, Rokoko, Vicon, OptiTrack, Bandai Namco, SMPL, Rigify, DeepMimic, Daz and the figure's own, with
sides before or after, namespaces and numbers. Pelvis, chest and abdomen have many names, so they are found in the tree:
the pelvis is where the legs meet, the chest where the arms meet, the abdomen halfway between.
"""

import re
from typing import NamedTuple

from models.humanoid.skeleton import BODIES, SEGMENTS

_SIDED = {
    "clavicle": ("clavicle", "collar", "collarbone", "shoulder"),
    "upper_arm": ("upperarm", "uparm", "uarm", "humerus", "shldr", "arm", "shoulder"),
    "forearm": ("forearm", "lowerarm", "lowarm", "farm", "elbow", "radius"),
    "hand": ("fingerbase", "hand"),
    "wrist": ("wrist", "hand"),
    "thigh": ("upleg", "upperleg", "uleg", "thigh", "femur", "hip"),
    "shank": ("lowleg", "lowerleg", "shin", "calf", "tibia", "knee", "leg"),
    "foot": ("foot", "ankle"),
    "toe": ("toebase", "toe", "toes", "toe0", "forefoot", "ball"),
}
_CENTRAL = {
    "chest": ("chest", "thorax", "torso", "spine4", "spine3", "spine2", "spine1", "spine", "t8"),
    "neck": ("neck", "neck1", "lowerneck"),
    "head": ("head",),
}
_PREFIX = re.compile(r"(mixamorig|character|skeleton|actor|armature|rig|bip|biped|valve|cc|base|j|def|org)\d*")
_WORDS = re.compile(r"[A-Z]?[a-z]+\d*|[A-Z]+(?![a-z])\d*|\d+")
_HELPER = re.compile(r"twist|roll|helper|corrective|muscle|mesh|nub|end|ik|pole|ctrl|target|site|marker|tip")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}


class Roles(NamedTuple):
    """Joints by the part they play.

    Attributes
    ----------
    segments : dict from figure body to joint index
        The joint that moves each segment; bodies without one are missing.
    ends : dict from figure body to joint index
        The joint at which the segments of arms and legs end.
    """

    segments: dict[str, int]
    ends: dict[str, int]


def roles_of(joints: tuple[str, ...], parents: tuple[int, ...]) -> Roles | str:
    """The roles of a skeleton's joints; or, if it cannot be a human's, the name of the missing pelvis or leg part."""
    named = _by_name(joints, parents)
    for part in ("left_thigh", "right_thigh", "left_shank", "right_shank"):
        if part not in named:
            return part
    pelvis = _meeting_point(named["left_thigh"], named["right_thigh"], parents)
    if pelvis is None or any(part == pelvis for part in named.values()):
        return "pelvis"
    segments = {"pelvis": pelvis}
    arms = [named[part] for part in ("left_upper_arm", "right_upper_arm") if part in named]
    chest = _meeting_point(arms[0], arms[1], parents) if len(arms) == 2 else named.get("chest")
    spine = _path(pelvis, chest, parents) if chest is not None else []
    if spine:
        segments["chest"] = spine[-1]
        if len(spine) > 1:
            # The middle joint below the chest, rounded down: the figure's abdomen ends where the ribs begin.
            segments["abdomen"] = spine[(len(spine) - 1) // 2]
    if (head := named.get("head", named.get("neck"))) is not None:
        segments["head"] = head
    ends: dict[str, int] = {}
    for side in ("left", "right"):
        for part in ("clavicle", "upper_arm", "forearm", "thigh", "shank", "foot"):
            if f"{side}_{part}" in named:
                segments[f"{side}_{part}"] = named[f"{side}_{part}"]
        # If both exist, the wrist is the end of the forearm, and the hand beyond it (CMU) carries all the rotation.
        wrist, hand = named.get(f"{side}_wrist"), named.get(f"{side}_hand")
        if (last := hand if hand is not None else wrist) is not None:
            segments[f"{side}_hand"] = last
        chain = (("upper_arm", named.get(f"{side}_forearm")), ("forearm", wrist),
                 ("thigh", named.get(f"{side}_shank")), ("shank", named.get(f"{side}_foot")),
                 ("foot", named.get(f"{side}_toe")))  # fmt: skip
        for part, end in chain:
            if end is not None and segments.get(f"{side}_{part}") in ancestry(end, parents)[1:]:
                ends[f"{side}_{part}"] = end
    for part in ("left_thigh", "right_thigh"):
        if part not in ends:
            return f"{part.removesuffix('thigh')}shank below its thigh"
    return Roles({body: segments[body] for body in BODIES if body in segments}, ends)


def _base(name: str) -> tuple[str, str]:
    """Side ('' if none) and bare name of a joint: ``Bip01 L UpperArm`` → left, upperarm."""
    words = [word.lower() for word in _WORDS.findall(name.rsplit(":", 1)[-1].rsplit("|", 1)[-1])]
    while len(words) > 1 and _PREFIX.fullmatch(words[0]):
        words = words[1:]
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    bare = "".join(word for word in words if word not in _SIDES)
    known = {alias for aliases in _SIDED.values() for alias in aliases}
    if side and bare not in known:
        # thigh.L.001, lThighBend, and the mirrored chains of some rigs
        short = bare.rstrip("0123456789").removesuffix("bend")
        bare = short if short in known else bare
    if not side and bare[:1] in ("l", "r"):
        for short in (bare[1:], bare[1:].removesuffix("bend")):
            if short in known:
                return _SIDES[bare[0]], short  # lfemur
    return side, bare


def _by_name(joints: tuple[str, ...], parents: tuple[int, ...]) -> dict[str, int]:
    """Joint index of each part found by name alone; joints with children take precedence over leaves."""
    bases: dict[tuple[str, str], int] = {}
    leaves = set(range(len(joints))) - set(parents)
    for index in sorted(range(len(joints)), key=lambda joint: joint in leaves):
        side, bare = _base(joints[index])
        if not _HELPER.search(bare):
            bases.setdefault((side, bare), index)
    found: dict[str, int] = {}

    def find(part: str, side: str, aliases: tuple[str, ...]) -> None:
        candidates = [bases[side, alias] for alias in aliases if (side, alias) in bases]
        if candidates:
            found[part] = min(candidates, key=lambda joint: joint in leaves)

    for part, aliases in _CENTRAL.items():
        find(part, "", aliases)
    for side in ("left", "right"):
        for part, aliases in _SIDED.items():
            find(f"{side}_{part}", side, aliases)
        ankle, foot = bases.get((side, "ankle")), bases.get((side, "foot"))
        if ankle is not None and foot is not None and ankle in ancestry(foot, parents):
            # SMPL's foot is the ball of the foot.
            found[f"{side}_foot"] = ankle
            found.setdefault(f"{side}_toe", foot)
        # A "shoulder" is the clavicle if there is an arm joint as well, and otherwise the upper arm.
        if found.get(f"{side}_clavicle") == found.get(f"{side}_upper_arm"):
            found.pop(f"{side}_clavicle", None)
    return found


def ancestry(joint: int, parents: tuple[int, ...]) -> list[int]:
    """A joint, its parent, and so on up to the root."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(parents[chain[-1]])
    return chain


def _meeting_point(one: int, other: int, parents: tuple[int, ...]) -> int | None:
    """The nearest common ancestor of two joints, other than themselves."""
    above = set(ancestry(other, parents)[1:])
    return next((joint for joint in ancestry(one, parents)[1:] if joint in above), None)


def _path(top: int, bottom: int, parents: tuple[int, ...]) -> list[int]:
    """Joints from below `top` down to `bottom`; empty if `bottom` is no descendant of `top`."""
    chain = ancestry(bottom, parents)
    return chain[: chain.index(top)][::-1] if top in chain else []


def unused(roles: Roles, joints: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the joints that play no part."""
    used = {*roles.segments.values(), *roles.ends.values()}
    return tuple(joint for index, joint in enumerate(joints) if index not in used)


def missing(roles: Roles) -> tuple[str, ...]:
    """Segments of the figure that no joint moves, each with the segment that it follows instead."""
    bodies = (segment for segment in SEGMENTS if segment.body not in roles.segments)
    return tuple(
        f"{segment.body} (follows {'pelvis and chest' if segment.body == 'abdomen' else BODIES[segment.parent]})"
        for segment in bodies
    )
