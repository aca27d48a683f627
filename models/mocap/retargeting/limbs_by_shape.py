"""Pairs of limbs in a joint tree: two chains of joints with long bones of the same lengths that leave one joint.

A *limb* is a chain of joints from a fork of the tree out, with two long bones a–b and b–c. Joints within a bone, such
as twist joints, lie on it and do not bend: a bone is as long as it stays straight during the motion.
"""

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from geometry.quaternions import unit
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.straight_bones import MAX_DISTANCE_RATIO

ARM_RATIOS = (0.4, 0.85)  # length of the arms over that of the legs, without hands and feet: 0.54 to 0.72 in captures
_SAMPLE_COUNT = 120  # frames in which bones are measured
_SAME_PLACE_RATIO = 0.01  # distance of joints at one place over the length of their chain
# Distance of a joint before a bone from the bone's first joint, over its length, up to which the bone begins at the
# outer one: a joint in the buttock has 0.08, twist joints have 0.25 and more.
NEAR_RATIO = 0.12
_MAX_BEND_RANGE = np.deg2rad(4.0)  # largest range of the bend at a joint within a bone: a captured wrist has more
# Length of the lower bone over the upper one, 0.65 to 1.15 in captures; and the likeliest one, for a wrist that does
# not bend: the next joint of the hand is at 1.3.
_LOWER_BONE_RATIOS, _LOWER_BONE_RATIO = (0.6, 1.5), 0.95
_MAX_SIDE_RATIO = 1.15  # of bones left and right, and of their distances from the fork: up to 1.06 in CMU's captures
# A chain from the pelvis to a fingertip has some 18 joints; a body with more limbs at one joint is no human's.
_MAX_CHAIN_LENGTH, _MAX_FORK_LIMBS = 24, 12


class Tree(NamedTuple):
    """A skeleton in m frames: its joints, and as further nodes their tips.

    Attributes
    ----------
    n_joints : int
        Number of joints, which are the first nodes.
    parents : tuple of int
        Parent of each node.
    children : tuple of tuples of int
        Children of each node.
    places : array of shape (m, nodes, 3)
        Positions, in the file's axes and unit.
    bones : array of shape (nodes,)
        Distances from the parents, medians over time.
    """

    n_joints: int
    parents: tuple[int, ...]
    children: tuple[tuple[int, ...], ...]
    places: Array
    bones: Array

    def joints_at(self, node: int) -> list[int]:
        """Children of a node that are joints."""
        return [child for child in self.children[node] if child < self.n_joints]

    def distances(self, nodes: int | Sequence[int], other: int) -> Array:
        """Distances of nodes from another one, medians over time."""
        return median_length(self.places[:, nodes] - self.places[:, [other] if np.ndim(nodes) else other])


class Limb(NamedTuple):
    """A limb.

    Attributes
    ----------
    chain : tuple of int
        Its nodes from the fork out.
    ends : tuple of three ints
        The nodes a, b and c at which its long bones end.
    lengths : tuple of two floats
        Lengths of these bones.
    start : float
        Length of the way from the fork to the first bone.
    """

    chain: tuple[int, ...]
    ends: tuple[int, int, int]
    lengths: tuple[float, float]
    start: float

    def is_like(self, other: "Limb") -> bool:
        """Whether another limb begins as far from the fork, with bones of the same lengths."""
        ratio = np.exp(np.abs(np.log(np.divide(self.lengths, other.lengths)))).max()
        return max(ratio, 1.0 + abs(self.start - other.start) / self.lengths[0]) < _MAX_SIDE_RATIO


class LimbPair(NamedTuple):
    """Two limbs that are alike, and the joint that they leave."""

    fork: int
    limbs: tuple[Limb, Limb]

    @property
    def length(self) -> float:
        """Mean length of both bones."""
        return sum(sum(limb.lengths) for limb in self.limbs) / 2.0

    @property
    def nodes(self) -> frozenset[int]:
        """All nodes of both limbs."""
        return frozenset(node for limb in self.limbs for node in limb.chain)

    @property
    def cost(self) -> tuple[float, float]:
        """Minus the upper bones' length, and the logarithmic deviation of the lower ones from the likeliest ratio."""
        deviations = (np.log(limb.lengths[1] / limb.lengths[0] / _LOWER_BONE_RATIO) for limb in self.limbs)
        return -sum(limb.lengths[0] for limb in self.limbs), float(sum(map(abs, deviations)))


def tree_of(motion: SourceMotion, positions: Array, rotations: Array) -> Tree:
    """The tree of a motion's joints, from their global positions (n, joints, 3) and rotations (n, joints, 4)."""
    sample = np.unique(np.linspace(0, motion.n_frames - 1, _SAMPLE_COUNT).round().astype(int))
    parents, places = list(motion.parents), [positions[sample]]
    for joint in np.flatnonzero(motion.tips.any(axis=1)).tolist():
        parents.append(joint)
        tip = positions[sample, joint] + quaternions.rotated(rotations[sample, joint], motion.tips[joint])
        places.append(tip[:, None])
    nodes = np.concatenate(places, axis=1)
    bones = median_length(nodes - nodes[:, [max(parent, 0) for parent in parents]])
    children = (tuple(k for k, parent in enumerate(parents) if parent == node) for node in range(len(parents)))
    return Tree(len(motion.joints), tuple(parents), tuple(children), nodes, bones)


def median_length(vectors: Array) -> Array:
    """Median over time of the lengths of vectors (m, …, 3)."""
    return np.median(np.linalg.norm(vectors, axis=-1), axis=0)


def limb_pairs(tree: Tree) -> list[LimbPair]:
    """Every two limbs of a tree that are alike and leave one joint, without those too short to be arms.

    Of pairs that bend at the same joints b, the one with the longest upper bones, and then the likeliest lower ones.
    """
    reach, furthest = np.zeros(len(tree.bones)), np.full(len(tree.bones), -1)
    for node in reversed(range(len(tree.bones))):
        for child in tree.children[node]:
            if tree.bones[child] + reach[child] > reach[node]:
                reach[node], furthest[node] = tree.bones[child] + reach[child], child

    def chain(node: int) -> Iterator[int]:
        while node >= 0:
            yield node
            node = int(furthest[node])

    best: dict[tuple[int, int], LimbPair] = {}
    for fork, children in enumerate(tree.children):
        chains = [nodes for child in children if len(nodes := tuple(chain(child))) > 2]
        limbs = [found for nodes in chains if len(chains) > 1 and (found := list(_limbs(nodes, tree)))]
        if len(limbs) > _MAX_FORK_LIMBS:
            continue
        for one, other in (both for some, others in combinations(limbs, 2) for both in product(some, others)):
            if one.is_like(other):
                pair, bends = LimbPair(fork, (one, other)), (one.ends[1], other.ends[1])
                best[bends] = min(best.get(bends, pair), pair, key=lambda pair: pair.cost)
    longest = max((pair.length for pair in best.values()), default=0.0)
    return [pair for pair in best.values() if pair.length > ARM_RATIOS[0] * longest]


def _limbs(chain: tuple[int, ...], tree: Tree) -> Iterator[Limb]:
    """The limbs that a chain of nodes may be."""
    near, nodes = _SAME_PLACE_RATIO * tree.bones[[*chain]].sum(), list[int]()
    for node in chain:  # of nodes at the same place, the outermost joint: it has all their rotation
        if nodes and tree.distances(node, nodes[-1]) <= near:
            if node >= tree.n_joints:
                continue
            nodes.pop()
        nodes.append(node)
    del nodes[_MAX_CHAIN_LENGTH:]
    apart = median_length(tree.places[:, nodes, None] - tree.places[:, None, nodes])

    @cache
    def is_bone(first: int, last: int) -> bool:
        return _is_bone(nodes[first : last + 1], tree.places)

    for a, b, c in combinations(range(len(nodes)), 3):
        if nodes[c] >= tree.n_joints and tree.parents[nodes[c]] != nodes[b]:
            continue  # the tip of a hand or foot, not of forearm or shank
        upper, lower = float(apart[a, b]), float(apart[b, c])
        in_proportion = _LOWER_BONE_RATIOS[0] * upper < lower < _LOWER_BONE_RATIOS[1] * upper
        # A clavicle or a joint beside the pelvis is shorter than the bone beyond.
        if not in_proportion or (a > 0 and apart[a - 1, a] > upper) or apart[a, a + 1] < NEAR_RATIO * upper:
            continue
        ends = (nodes[a], nodes[b], nodes[c])
        if is_bone(a, b) and is_bone(b, c) and not _is_bone(ends, tree.places):
            yield Limb(chain, ends, (upper, lower), float(tree.bones[[*chain[: chain.index(ends[0]) + 1]]].sum()))


def _is_bone(nodes: Sequence[int], places: Array) -> bool:
    """Whether the joints between the first and the last node lie on a straight bone throughout, as twist joints do."""
    if len(nodes) < 3:
        return True
    points = places[:, [*nodes]]
    steps, bone = unit(np.diff(points, axis=1)), points[:, -1:] - points[:, :1]
    bends = np.arccos(np.clip(np.sum(steps[:, 1:] * steps[:, :-1], axis=2), -1.0, 1.0))
    moments = np.linalg.norm(np.cross(points[:, 1:-1] - points[:, :1], bone), axis=2)
    offsets = moments / np.maximum(np.sum(bone * bone, axis=2), np.finfo(float).tiny)
    ranges = np.subtract(*np.quantile(bends, (0.95, 0.05), axis=0))
    return bool(ranges.max() < _MAX_BEND_RANGE and np.quantile(offsets, 0.95, axis=0).max() < MAX_DISTANCE_RATIO)
