"""Assignment of joints whose names say nothing, by the joint tree and by where the joints are during the motion.

The legs are the longest two limbs that are alike and leave one joint, the arms two shorter ones that leave another
(`limbs_by_shape`); several such limbs, as of a spider, a skirt or wings, are refused. With these, everything else is
judged as for named skeletons: the vertical, and that it is no animal (`upright`, `body_checks`). The trunk is upright
at times, and hips, shoulders and trunk are in proportion to the legs.

Left is where the body says: toes and knees point ahead, elbows back, and hands are held out ahead (`side_evidence`).
Two of these four decide, or knees that are bent far; none may contradict, nor may the side in a joint's name.
"""

from itertools import permutations

import numpy as np

from geometry.arrays import Array
from geometry.quaternions import unit
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_checks import check_biped, side_evidence
from models.mocap.retargeting.body_lines import MIN_SIDE_EVIDENCE, SIDES, BodyLines, body_lines
from models.mocap.retargeting.joint_names import JointName
from models.mocap.retargeting.limbs_by_shape import (
    ARM_RATIOS,
    NEAR_RATIO,
    Limb,
    LimbPair,
    Tree,
    limb_pairs,
    median_length,
    tree_of,
)
from models.mocap.retargeting.skeleton_roles import Roles, ancestry, assembled, joints_below, names_of
from models.mocap.retargeting.upright import AXES, up_axis

_MAX_PAIR_COUNT = 24  # of pairs of limbs: captures have up to 4
_SEVERAL = "several limbs might be its legs or arms"
# Lengths over that of thigh and shank: 0.13 to 0.22, 0.23 to 0.47 and 0.48 to 0.62 in captures.
_HIP_RATIOS, _SHOULDER_RATIOS, _TRUNK_RATIOS = (0.08, 0.5), (0.2, 0.9), (0.35, 1.1)
# Length of the legs over that of others that make a body, and of the arms over that of limbs that are neither.
_MIN_LEAD = 1.25
_MIN_STANDING_COSINE = 0.8  # of the trunk to the vertical, in a fifth of the frames
_MIN_SHOULDER_COSINE = 0.5  # mean cosine of shoulders and hips
# Least evidence of knees alone: depth cameras see straight knees bend back by up to 24°, with a sine of 0.4.
_MIN_KNEE_EVIDENCE = 0.45
_MAX_NECK_JOINTS = 4  # that bend, from the chest to the head: two or three in most rigs, four in MakeHuman's
_MAX_HEAD_DEPTH = 0.1  # of the head's joint below the shoulders [leg lengths]: DeepMimic's is at their height
_MAX_HELPER_RATIO = 0.25  # distance of helpers from a joint of the neck over that of the next joint
_MIN_TOE_RATIO = 0.8  # distance of the least toe from the ankle over that of the furthest: 0.85 in MakeHuman's feet
_UNNAMED = JointName("", "", False, False)


class _Unclear(Exception):
    """Why two pairs of limbs are no human's legs and arms."""


def roles_by_shape(motion: SourceMotion, up: str | None = None) -> Roles | str:
    """The roles of a human skeleton's joints, whatever their names; or why they are not clear.

    Parameters
    ----------
    motion : SourceMotion
        The motion of one body.
    up : str or None
        The file's axis that points up, if the user states it.
    """
    rotations = motion.global_rotations()
    positions = motion.global_positions(rotations)
    tree = tree_of(motion, positions, rotations)
    pairs = limb_pairs(tree)
    if len(pairs) > _MAX_PAIR_COUNT:
        return _SEVERAL
    found: dict[frozenset[int], tuple[float, LimbPair, LimbPair, Roles]] = {}
    reasons: list[tuple[float, str]] = []
    for legs, arms in permutations(pairs, 2):
        least, most = (ratio * legs.length for ratio in ARM_RATIOS)
        if legs.fork == arms.fork or legs.nodes & arms.nodes or not least < arms.length < most:
            continue
        size = legs.length + arms.length
        try:
            roles = _body_roles(motion, tree, legs, arms, positions, rotations, up)
        except _Unclear as reason:
            reasons.append((size, str(reason)))
        except MotionFileError as error:
            reasons.append((size, f"{error.what}: {error.expected}"))
        else:
            # Of the same chains, the longest bones: others end within these.
            new, nodes = (size, legs, arms, roles), legs.nodes | arms.nodes
            found[nodes] = max(found.get(nodes, new), new, key=lambda one: one[0])
    if not found:
        return max(reasons)[1] if reasons else "it has no two legs and two arms of equal bones that bend"
    *others, (_, legs, arms, roles) = sorted(found.values(), key=lambda one: one[1].length)
    free = [pair.length for pair in pairs if pair.nodes.isdisjoint(legs.nodes | arms.nodes)]
    longest_free, next_leg = max(free, default=0.0), max((other.length for _, other, *_ in others), default=0.0)
    if longest_free * _MIN_LEAD > arms.length or next_leg * _MIN_LEAD > legs.length:
        return _SEVERAL
    return roles


def _body_roles(
    motion: SourceMotion, tree: Tree, legs: LimbPair, arms: LimbPair, positions: Array, rotations: Array, up: str | None
) -> Roles:
    """The roles of all joints if two pairs of limbs are legs and arms; positions and rotations are the joints'."""
    hips, shoulders = (
        unit(tree.places[:, one.ends[0]] - tree.places[:, other.ends[0]]) for one, other in (legs.limbs, arms.limbs)
    )
    cosine = float(np.sum(hips * shoulders, axis=1).mean())
    if not abs(cosine) > _MIN_SHOULDER_COSINE:  # nor NaN, of limbs that begin at one place
        raise _Unclear("its shoulders are not parallel to its hips")
    head = _head(tree, legs, arms, motion.still_joints)
    choices: list[tuple[dict[str, int], Roles, BodyLines]] = []
    for sides in (SIDES, SIDES[::-1]):
        named = {} if head is None else {"head": head}
        for side, leg, arm in zip(sides, legs.limbs, arms.limbs[:: int(np.sign(cosine))], strict=True):
            named |= _leg_roles(side, leg, tree) | _arm_roles(side, arm, tree)
        roles = assembled(named, (_UNNAMED,) * len(motion.joints), motion.parents)
        if isinstance(roles, str):
            raise _Unclear(f"no joint was found for the {roles}")
        choices.append((named, roles, body_lines(motion, roles, positions, rotations)))
    named, roles, lines = choices[0 if _has_true_sides(choices[0][2]) else 1]
    _check_proportions(lines)
    check_biped(motion, lines)
    body = joints_below(roles.segments["pelvis"], motion.parents)
    vertical = up_axis(motion, roles, lines, positions[:, body], up)
    # With arms longer than legs, these seem to be exchanged, in a body that hangs upside down.
    if np.isfinite(vertical.lead) and not any((vertical.axis == AXES[name]).all() for name in ("+Y", "+Z")):
        raise _Unclear("up would be an axis that programs do not write: --up states it")
    if np.quantile(unit(lines.trunk) @ vertical.axis, 0.8) < _MIN_STANDING_COSINE:
        raise _Unclear("its trunk is hardly ever upright")
    names = names_of(motion.joints)
    for role, joint in named.items():
        if names[joint].side not in ("", role.partition("_")[0]):
            raise _Unclear(f"by toes, knees and arms, {motion.joints[joint]} is its {role.replace('_', ' ')}")
    return roles


def _has_true_sides(lines: BodyLines) -> bool:
    """Whether left and right are as in `lines`, rather than exchanged."""
    evidence = side_evidence(lines)
    clear = [value for value in evidence if abs(value) > MIN_SIDE_EVIDENCE]
    if len({value > 0.0 for value in clear}) != 1 or (len(clear) < 2 and abs(evidence.knees) < _MIN_KNEE_EVIDENCE):
        raise _Unclear("toes, knees and arms do not show which side is left")
    return clear[0] > 0.0


def _check_proportions(lines: BodyLines) -> None:
    """Raise if hips, shoulders or trunk are too short or long for a human's."""
    for part, vectors, (least, most) in (
        ("hips", lines.left, _HIP_RATIOS),
        ("shoulders", lines.shoulders[:, 0] - lines.shoulders[:, 1], _SHOULDER_RATIOS),
        ("trunk", lines.trunk, _TRUNK_RATIOS),
    ):
        if not least < (ratio := float(median_length(vectors)) / lines.leg) < most:
            raise _Unclear(f"its {part} would measure {ratio:.2f} leg lengths, beyond the {least} to {most} of humans")


def _leg_roles(side: str, leg: Limb, tree: Tree) -> dict[str, int]:
    """Hip, knee, ankle and the base of the toes; the last two only if they are joints."""
    hip, knee, ankle = leg.ends
    roles = {f"{side}_thigh": hip, f"{side}_shank": knee}
    if ankle < tree.n_joints:
        roles[f"{side}_foot"] = ankle
        if (toe := _toe(ankle, tree)) is not None:
            roles[f"{side}_toe"] = toe
    return roles


def _toe(ankle: int, tree: Tree) -> int | None:
    """The middle one of the first joints that are in the outer half of the foot; not a heel, nor a bone of the foot."""
    below = [node for node in joints_below(ankle, tree.parents) if node != ankle]
    distances = dict(zip(below, tree.distances(below, ankle), strict=True))
    outer = {node for node in below if distances[node] > max(distances.values()) / 2.0}
    toes = [k for k in outer if k < tree.n_joints and outer.isdisjoint(ancestry(tree.parents[k], tree.parents))]
    if not toes:
        return None
    toes = [k for k in toes if distances[k] > _MIN_TOE_RATIO * max(distances[toe] for toe in toes)]
    middle = tree.places[:, toes].mean(axis=1)
    return min(toes, key=lambda toe: float(median_length(tree.places[:, toe] - middle)))


def _arm_roles(side: str, arm: Limb, tree: Tree) -> dict[str, int]:
    """Clavicle, shoulder, elbow, wrist and hand: the wrist is where thumb and fingers part, the hand may be beyond."""
    shoulder, elbow, hand = arm.ends
    roles = {f"{side}_upper_arm": shoulder, f"{side}_forearm": elbow}
    inner = arm.chain[: arm.chain.index(shoulder)]
    if clavicles := [k for k in inner if tree.distances(k, shoulder) > NEAR_RATIO * arm.lengths[0]]:
        roles[f"{side}_clavicle"] = clavicles[-1]
    if hand < tree.n_joints:
        forearm = arm.chain[arm.chain.index(elbow) + 1 : arm.chain.index(hand)]
        wrist = next((joint for joint in forearm if len(tree.joints_at(joint)) > 1), hand)
        roles |= {f"{side}_wrist": wrist, f"{side}_hand": hand}
    return roles


def _head(tree: Tree, legs: LimbPair, arms: LimbPair, still: frozenset[int]) -> int | None:
    """The last joint that moves in the only chain from the chest up, before it forks (eyes, hair); None if unclear.

    A chain upwards is there in any case: without, legs and arms may be exchanged.
    """
    hips, shoulders = (tree.places[:, [limb.ends[0] for limb in pair.limbs]].mean(axis=1) for pair in (legs, arms))
    up, taken = unit(shoulders - hips), legs.nodes | arms.nodes
    found, rises = list[int](), False
    for start in tree.joints_at(arms.fork):
        if not taken.isdisjoint(joints_below(start, tree.parents)):
            continue
        chain = [start]
        while len(beyond := _far_children(chain[-1], tree)) == 1:
            chain += beyond
        moving = [joint for joint in chain if joint not in still] or chain[:1]
        heights = np.median(np.sum((tree.places[:, chain] - shoulders[:, None]) * up[:, None], axis=2), axis=0)
        high = [joint for joint, height in zip(chain, heights, strict=True) if height > -_MAX_HEAD_DEPTH * legs.length]
        rises |= bool(high)
        if moving[-1] in high and len(moving) <= _MAX_NECK_JOINTS:
            found.append(moving[-1])
    if not rises:
        raise _Unclear("nothing above its shoulders might be a head")
    return found[0] if len(found) == 1 else None


def _far_children(node: int, tree: Tree) -> list[int]:
    """Joints below a node, without helpers close to it."""
    joints = tree.joints_at(node)
    return [joint for joint in joints if tree.bones[joint] > _MAX_HELPER_RATIO * max(tree.bones[joints])]
