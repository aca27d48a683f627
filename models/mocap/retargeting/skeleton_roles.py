"""Assignment of a foreign skeleton's joints to the figure's segments, by name and by position in the joint tree.

Names alone do not decide: each part of a limb lies below the one before, and a limb that continues with an unknown name
is refused. Pelvis, chest and abdomen have many names, so they are found in the tree: the pelvis is where the legs meet,
the chest where the arms meet, the abdomen halfway between. The tests cover 72 naming schemes.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

from models.humanoid.skeleton import BODIES, SEGMENTS
from models.mocap.retargeting.joint_names import JointName, joint_names

# Words for each part, with their rank: a word that may also mean a neighbouring part (a leg is a shank below an upper
# leg, and a thigh above a knee) ranks behind one that may not.
_LEG = {
    "thigh": {"femur": 0, "thigh": 0, "upleg": 0, "upperleg": 0, "uleg": 0, "legupper": 0, "hip": 1,
              "leg": 2},
    "shank": {"tibia": 0, "shank": 0, "shin": 0, "calf": 0, "lowerleg": 0, "lowleg": 0, "loleg": 0, "leglower": 0,
              "knee": 0, "leg": 1},
    "foot": {"foot": 0, "ankle": 0, "footankle": 0, "talus": 0, "calcn": 1},
    "toe": {"toebase": 0, "toe": 0, "toes": 0, "bigtoe": 0, "forefoot": 0, "ball": 0, "football": 0, "foot": 1},
}  # fmt: skip
_ARM = {
    "clavicle": {"clavicle": 0, "clavicula": 0, "clav": 0, "collar": 0, "collarbone": 0, "scapula": 0, "shoulder": 1},
    "upper_arm": {"upperarm": 0, "uparm": 0, "uarm": 0, "armupper": 0, "humerus": 0, "shldr": 0, "bicep": 0,
                  "arm": 0, "shoulder": 1},
    "forearm": {"forearm": 0, "lowerarm": 0, "lowarm": 0, "loarm": 0, "armlower": 0, "farm": 0, "elbow": 0, "ulna": 0,
                "radius": 0},
    "wrist": {"wrist": 0, "carpus": 0, "handwrist": 0, "hand": 1},
}  # fmt: skip
LIMBS = (tuple(_LEG), (*_ARM, "hand"))  # parts from the trunk out
_HAND = ("fingerbase", "hand")  # beyond the wrist
_CHEST = frozenset(("chest", "upperchest", "thorax", "torso", "spine", "upperbody"))
_NECK = frozenset(("neck", "lowerneck", "upperneck", "necklower", "neckupper", "necktwist"))
_SIDED_WORDS = frozenset(word for limb in (_LEG, _ARM) for words in limb.values() for word in words) | {*_HAND}
_CENTRAL_WORDS = _CHEST | _NECK | {"head"}
_OPTIONAL_PARTS = ("clavicle", "toe")  # parts without which a limb is complete
# Costs of a limb's chain, in decreasing priority: each exceeds all sums of the next.
_MISSING_COST, _RANK_COST, _STILL_COST = 10_000, 100, 1


class Roles(NamedTuple):
    """Joints by the part of the body that they represent.

    Attributes
    ----------
    segments : dict from figure body to joint index
        The joint that moves each segment; bodies without one are missing.
    ends : dict from figure body to joint index
        The joint at which the segments of arms and legs end.
    spine : tuple of int
        Joints from beyond the pelvis to the chest, one of which is the abdomen; empty if the abdomen is stated.
    """

    segments: dict[str, int]
    ends: dict[str, int]
    spine: tuple[int, ...] = ()


def roles_of(
    joints: tuple[str, ...], parents: tuple[int, ...], pelvis: int | None = None, still: Collection[int] = ()
) -> Roles | str:
    """The roles of a skeleton's joints; or, if it is not recognised as a human's, the part without a joint.

    The pelvis is found, too, unless it is stated. Of limbs with equal names, one of a control rig that does not move
    (joints `still`) is not taken.
    """
    names = names_of(joints)
    named: dict[str, int] = {} if pelvis is None else {"pelvis": pelvis}
    for side in ("left", "right"):
        for limb in (_LEG, _ARM):
            named |= _find_limb(side, limb, names, parents, still)
        if (toe := named.get(f"{side}_toe")) is not None:
            if f"{side}_foot" not in named and parents[toe] == named.get(f"{side}_shank"):
                named[f"{side}_foot"] = named.pop(f"{side}_toe")  # an ankle, by what is right above it
            else:
                named[f"{side}_toe"] = _middle_toe(toe, joints, names, parents)
        if (wrist := named.get(f"{side}_wrist")) is not None:
            # Beyond a wrist there may be a hand (CMU): it carries all the rotation.
            below = [joint for joint in joints_below(wrist, parents) if names[joint].side == side]
            hands = [joint for word in _HAND for joint in below if names[joint].bare == word]
            named[f"{side}_hand"] = next(iter(hands), wrist)
    roles = assembled(named, names, parents)
    if isinstance(roles, str):
        return roles
    for side in ("left", "right"):
        for upper, lower in (("shank", "foot"), ("upper_arm", "forearm"), ("forearm", "hand")):
            joint = named.get(f"{side}_{upper}")
            if joint is None or f"{side}_{lower}" in named:
                continue
            own = names[joint].bare
            if further := [k for k in joints_below(joint, parents) if not names[k].helper and names[k].bare != own]:
                return f"{side}_{lower}, though {joints[further[0]]} is below {joints[joint]}"
    return roles


def has_legs(top: int, joints: tuple[str, ...], parents: tuple[int, ...]) -> bool:
    """Whether both sides' thighs, each with a shank below it, are below a joint, by the names of the joints there."""
    below = joints_below(top, parents)
    names = dict(zip(below, names_of(tuple(joints[k] for k in below)), strict=True))
    legs = set[str]()
    thighs: dict[int, frozenset[tuple[str, str]]] = {parents[top]: frozenset()}  # side and word of those above
    for k in below:
        above, (side, bare, *_) = thighs[parents[k]], names[k]
        if bare in _LEG["shank"] and any(thigh[0] == side and thigh[1] != bare for thigh in above):
            legs.add(side)
        thighs[k] = above | {(side, bare)} if bare in _LEG["thigh"] else above
    return {"left", "right"} <= legs


def names_of(joints: tuple[str, ...]) -> tuple[JointName, ...]:
    """Sides and words of joints' names."""
    return joint_names(joints, _SIDED_WORDS, _CENTRAL_WORDS)


def assembled(named: dict[str, int], names: tuple[JointName, ...], parents: tuple[int, ...]) -> Roles | str:
    """Roles from the limbs' joints, and the trunk's and head's from the tree; or the name of a missing part.

    Parameters
    ----------
    named : dict from part to joint index
        Figure bodies, and ``left_wrist``, ``left_toe`` and so on for the ends of forearms and feet.
    names : tuple of JointName
        The joints' parsed names.
    parents : tuple of int
        Parent of each joint.
    """
    for part in ("left_thigh", "right_thigh", "left_shank", "right_shank"):
        if part not in named:
            return part
    for side in ("left", "right"):
        if named[f"{side}_thigh"] not in ancestry(named[f"{side}_shank"], parents)[1:]:
            return f"{side}_shank below its thigh"
    pelvis = named.get("pelvis", _meeting_point(named["left_thigh"], named["right_thigh"], parents))
    if pelvis is None:
        return "pelvis"
    segments = {"pelvis": pelvis} | {part: named[part] for part in BODIES if part in named}
    spine = _find_spine(pelvis, named, names, parents)
    choice = () if "abdomen" in segments else tuple(spine)
    if spine:
        segments.setdefault("chest", spine[-1])
        if len(spine) > 1:
            segments.setdefault("abdomen", middle_of(spine))
    if "head" not in segments and (head := _find_head(spine, named, names, parents)) is not None:
        segments["head"] = head
    ends: dict[str, int] = {}
    for side in ("left", "right"):
        wrist = named.get(f"{side}_wrist", named.get(f"{side}_hand"))
        chain = (("upper_arm", named.get(f"{side}_forearm")), ("forearm", wrist),
                 ("thigh", named.get(f"{side}_shank")), ("shank", named.get(f"{side}_foot")),
                 ("foot", named.get(f"{side}_toe")))  # fmt: skip
        for part, end in chain:
            if end is not None and segments.get(f"{side}_{part}") in ancestry(end, parents)[1:]:
                ends[f"{side}_{part}"] = end
    return Roles({body: segments[body] for body in BODIES if body in segments}, ends, choice)


def middle_of(spine: Sequence[int]) -> int:
    """The middle joint below the chest, rounded down: the figure's abdomen ends where the ribs begin."""
    return spine[(len(spine) - 1) // 2]


def _find_limb(
    side: str, limb: dict[str, dict[str, int]], names: tuple[JointName, ...], parents: tuple[int, ...],
    still: Collection[int],
) -> dict[str, int]:  # fmt: skip
    """The likeliest joints of a limb's parts, each below the one before.

    Of all such chains, the one with the fewest missing parts; then the one with words that mean only their part, that
    moves, and that comes first in the file. Two joints with one word (``thigh.L``, ``thigh.L.001``) are one part.
    """
    parts = tuple(limb)
    above = {k: set(ancestry(k, parents)[1:]) for k, name in enumerate(names) if name.side == side}
    missing_costs = [_MISSING_COST * (1 if part in _OPTIONAL_PARTS else 10) for part in parts]
    # Chains that begin at a part: its index, the cost, and the parts' joints.
    chains: list[tuple[int, int, tuple[tuple[str, int], ...]]] = [(len(parts), 0, ())]
    for k in reversed(range(len(parts))):
        longer: list[tuple[int, int, tuple[tuple[str, int], ...]]] = []
        for joint in above:
            if (rank := limb[parts[k]].get(names[joint].bare)) is None:
                continue
            cost, rest = min(
                (cost + sum(missing_costs[k + 1 : first]), chain)
                for first, cost, chain in chains
                if not chain or (joint in above[chain[0][1]] and names[joint].bare != names[chain[0][1]].bare)
            )
            cost += _RANK_COST * (2 * rank + names[joint].noisy) + _STILL_COST * (joint in still)
            longer.append((k, cost, ((f"{side}_{parts[k]}", joint), *rest)))
        chains += longer
    return dict(min((cost + sum(missing_costs[:first]), chain) for first, cost, chain in chains)[1])


def _middle_toe(toe: int, joints: tuple[str, ...], names: tuple[JointName, ...], parents: tuple[int, ...]) -> int:
    """Of toes side by side, the middle one in the order of their names: it gives the direction of the foot."""
    limb = ancestry(toe, parents)
    foot = next((k for k in limb if names[k].bare != names[toe].bare), -1)
    toes = [k for k, name in enumerate(names)
             if name == names[toe] and len(above := ancestry(k, parents)) == len(limb) and foot in above]  # fmt: skip
    return sorted(toes, key=lambda k: joints[k])[(len(toes) - 1) // 2]


def _find_spine(
    pelvis: int, named: dict[str, int], names: tuple[JointName, ...], parents: tuple[int, ...]
) -> list[int]:  # fmt: skip
    """Joints from the pelvis (or from its common ancestor with the chest) to the chest, where the arms meet."""
    arms = [named[part] for part in ("left_upper_arm", "right_upper_arm") if part in named]
    free = _unassigned_joints(named, parents)
    if len(arms) == 1:  # the head stands for the other arm
        arms += [k for k in free if names[k].bare in _NECK | {"head"} and not names[k].side][:1]
    chest = named.get("chest", _meeting_point(arms[0], arms[1], parents) if len(arms) == 2 else None)
    if chest is None and len(arms) < 2:
        trunk = [k for k in free if names[k].bare in _CHEST and not names[k].side and k != pelvis]
        chest = max(trunk, key=lambda k: len(ancestry(k, parents)), default=None)
    if chest is None or chest == pelvis:
        return []
    down = ancestry(chest, parents)
    common = next((joint for joint in ancestry(pelvis, parents) if joint in down), None)
    # A root that is the chest has the pelvis below it.
    path = [chest] if common == chest else down[: down.index(common)][::-1] if common is not None else []
    while len(path) > 1 and names[path[-1]].bare in _NECK and "chest" not in named:
        path.pop()  # 3ds Max hangs the collar bones on the neck
    return path


def _find_head(
    spine: list[int], named: dict[str, int], names: tuple[JointName, ...], parents: tuple[int, ...]
) -> int | None:  # fmt: skip
    """The head, or the last joint of the neck, by name; or the end of a chain that continues beyond the chest."""
    free = [k for k in _unassigned_joints(named, parents) if not names[k].side]
    heads = [k for k in free if names[k].bare == "head"]
    if heads:
        return heads[0]
    if necks := [k for k in free if names[k].bare in _NECK]:
        return max(necks, key=lambda k: len(ancestry(k, parents)))
    words = {names[k].bare for k in spine} - {""}
    last = end = spine[-1] if spine else -1
    while spine and (beyond := [k for k in free if parents[k] == end and names[k].bare in words]):
        end = beyond[0]
    return end if end != last else None


def _unassigned_joints(named: dict[str, int], parents: tuple[int, ...]) -> list[int]:
    """Joints that are neither part of a limb nor an ancestor of one."""
    limbs = {joint for part, joint in named.items() if part.startswith(("left", "right"))}
    carrying = {joint for limb in limbs for joint in ancestry(limb, parents)}
    return [k for k in range(len(parents)) if k not in carrying and limbs.isdisjoint(ancestry(k, parents))]


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


def joints_below(top: int, parents: tuple[int, ...]) -> list[int]:
    """A joint and all its descendants."""
    below = {top}
    for joint, parent in enumerate(parents):
        if parent in below:
            below.add(joint)
    return sorted(below)


def unused(roles: Roles, joints: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the joints without a role."""
    used = {*roles.segments.values(), *roles.ends.values()}
    return tuple(joint for index, joint in enumerate(joints) if index not in used)


def missing(roles: Roles) -> tuple[str, ...]:
    """Segments of the figure that no joint moves, each with the segment that it follows instead."""
    bodies = (segment for segment in SEGMENTS if segment.body not in roles.segments)
    return tuple(
        f"{segment.body} (follows {'pelvis and chest' if segment.body == 'abdomen' else BODIES[segment.parent]})"
        for segment in bodies
    )
