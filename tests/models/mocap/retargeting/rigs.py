"""Synthetic rigs: a known motion of the figure, expressed on another skeleton and written as BVH."""

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from geometry import quaternions
from models.humanoid.skeleton import BODIES, SEGMENTS, figure_model
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import global_rotations
from tests.models.mocap.retargeting.rig_families import FAMILIES, NECKS, SPINES

ZERO_POSES = ("T", "A", "upright T", "upright A", "random", "along X", "legs up", "along bones Y")
UPS = {"+Y": (0, 1, 0), "+Z": (0, 0, 1), "-Y": (0, -1, 0), "-Z": (0, 0, -1), "+X": (1, 0, 0), "-X": (-1, 0, 0)}
TWISTS = ("{}Twist", "{}Roll", "{}_twist_01", "{}.001", "{}Part1")
ROOTS = ("hips", "above", "at rest", "on the floor", "carries")
PROPORTIONS = {"arm": (0.6, 1.6), "leg": (0.6, 1.6), "hips": (0.6, 1.6), "trunk": (0.8, 1.3), "shoulders": (0.85, 1.15),
               "foot": (0.7, 1.4)}  # fmt: skip
# What the root joint turns with.
_ROOT_FOLLOWS = {"above": "heading", "at rest": "moved", "on the floor": "shadow", "carries": ""}


@dataclass(frozen=True)
class Rig:
    """Names, zero pose, axes, proportions and file format of a skeleton."""

    family: str = "MotionBuilder"
    zero: str = "T"
    up: str = "+Y"
    turn: float = 0.0  # rotation of the whole file about its vertical [rad]
    unit: float = 0.01  # [m]
    order: str = "ZXY"  # order of Euler angles; "any": a random one for every joint
    twists: str = ""  # name pattern of twist joints within the bones
    beside: bool = False  # additional twist joints as leaves
    fingers: bool = False
    props: bool = False  # IK targets, a weapon, eyes, hair, tips
    reference: bool = False
    root: str = "hips"  # or a root above the hips that moves and turns ("above"), moves ("at rest"), is their
    # projection onto the floor ("on the floor"), or stands still while they move ("carries")
    namespace: str = ""
    without: tuple[str, ...] = ()  # missing parts: head, neck, clavicle, hand, foot, toe, abdomen
    below: int = 0  # additional spine joints below the abdomen,
    between: int = 0  # between abdomen and chest,
    over: int = 0  # and above the chest
    shared: str = "split"  # additional spine joints split a bone, or are "interpolated" at the place of the next one
    necks: int = 1
    hips: float | None = None  # additional joints between pelvis and thighs, at this share of the distance
    positions: bool = False  # position channels on every joint
    tips: float | None = 0.0  # length of End Sites as a share of the bone before; None: no End Sites
    shuffled: bool = False  # children in random order
    digits: int = 6
    time: int = 9  # digits of the frame time
    proportions: dict[str, float] = field(default_factory=dict)
    leading: int = 0  # frames of the zero pose in front of the motion
    seed: int = 0


def random_rig(rng: np.random.Generator) -> Rig:
    """A rig with a random combination of properties."""

    def chance(share):
        return bool(rng.random() < share)

    family = str(rng.choice(list(FAMILIES)))
    without = tuple(part for part in ("head", "neck", "clavicle", "toe", "abdomen", "hand", "foot") if chance(0.1))
    spare = 0 if "abdomen" in without else len(SPINES.get(family, "a b").split()) - 2
    below, between, over = np.bincount(rng.integers(3, size=int(rng.integers(spare + 1))), minlength=3).tolist()
    sizes = {part: float(rng.uniform(*span)) for part, span in PROPORTIONS.items() if chance(0.5)}
    sizes |= {
        part: float(rng.uniform(0.85, 1.15)) for part in ("upper_arm", "forearm", "thigh", "shank") if chance(0.5)
    }
    return Rig(
        family=family,
        zero=str(rng.choice(ZERO_POSES)),
        up=str(rng.choice(list(UPS), p=[0.4, 0.4, 0.05, 0.05, 0.05, 0.05])),
        turn=float(rng.choice([0.0, np.pi / 2, np.pi, -np.pi / 2, rng.uniform(-np.pi, np.pi)])),
        unit=float(rng.choice([1.0, 0.01, 0.0254, 0.001, 0.056444, float(10 ** rng.uniform(-3, 0.5))])),
        order="any" if chance(0.1) else "".join(rng.permutation(list("XYZ"))),
        twists=str(rng.choice(TWISTS)) if chance(0.3) else "",
        beside=chance(0.2), fingers=chance(0.3), props=chance(0.2), reference=chance(0.2),
        root=str(rng.choice(ROOTS)) if chance(0.4) else "hips",
        namespace=str(rng.choice(["", "", "Actor_1:", "char|", "Bob:rig:"])),
        without=without, below=below, between=between, over=over, shared=str(rng.choice(["split", "interpolated"])),
        necks=1 + int(family in NECKS and chance(0.5)),
        hips=float(rng.choice([0.0, 0.3, 0.6])) if chance(0.15) else None,
        positions=chance(0.15),
        tips=[0.0 if "foot" in without else None, 0.0, 0.3][int(rng.integers(3))],  # no ankle at all is refused
        shuffled=chance(0.5),
        digits=int(rng.choice([5, 6, 9])), time=int(rng.choice([6, 7, 9])),
        proportions=sizes if chance(0.5) else {},
        leading=int(chance(0.1)),
        seed=int(rng.integers(1 << 30)),
    )  # fmt: skip


class Joint(NamedTuple):
    """A joint of a rig.

    `place` is in the frame of its parent's segment. It turns with `body`: a body of the figure, the hips' heading or
    nothing (`_ROOT_FOLLOWS`); or with a rotation at a `share` between `body` and `other`. It also twists about the axis
    `about` of its bone.
    """

    name: str
    parent: str | None
    place: np.ndarray
    body: str
    other: str = ""
    share: float = 0.0
    about: int | None = None
    tip: np.ndarray | None = None


# Positions of the figure's joints in their parents [m].
_BODY_OFFSETS = {body: np.array(figure_model().body(body).pos) for body in BODIES}


def leg_scale(rig: Rig) -> float:
    """Length of the rig's legs over the figure's."""
    parts = [float(np.linalg.norm(_BODY_OFFSETS[f"left_{end}"])) for end in ("shank", "foot")]
    sizes = [rig.proportions.get(part, 1.0) * rig.proportions.get("leg", 1.0) for part in ("thigh", "shank")]
    return float(np.dot(sizes, parts) / sum(parts))


def _body_offsets(rig):
    """Position of every body of the figure in its parent, in the rig's proportions."""
    size = lambda *parts: np.prod([rig.proportions.get(part, 1.0) for part in parts])  # noqa: E731
    wide = np.array([1.0, rig.proportions.get("shoulders", 1.0), 1.0])
    sizes = {
        "abdomen": size("trunk"), "chest": size("trunk"), "head": size("trunk"), "clavicle": size("trunk") * wide,
        "upper_arm": size("trunk") * wide, "forearm": size("upper_arm", "arm"), "hand": size("forearm", "arm"),
        "thigh": size("hips"), "shank": size("thigh", "leg"), "foot": size("shank", "leg"),
    }  # fmt: skip
    bare = {body: body.removeprefix("left_").removeprefix("right_") for body in BODIES[1:]}
    return {body: _BODY_OFFSETS[body] * sizes[bare[body]] for body in BODIES[1:]}


def _joints(rig):
    """The rig's joints, parents first."""
    sides, centre, limbs = FAMILIES[rig.family]
    full_name = lambda text: rig.namespace + text.replace("~", " ")  # noqa: E731
    place, none = _body_offsets(rig), np.zeros(3)
    rows: list[Joint] = []

    def add(name, parent, at, body, *more):
        rows.append(Joint(name, parent, np.asarray(at, dtype=float), body, *more))
        return name

    def chain(top, names, at, lower, upper):
        """Add joints on a bone that turns with `lower` and ends at `upper`; the last joint and the remaining offset."""
        remaining = at
        for k, name in enumerate(names):
            share = (k + 1) / (len(names) + 1)
            if rig.shared == "split":
                top = add(full_name(name), top, at / (len(names) + 1), lower)
                remaining = at / (len(names) + 1)
            else:  # also where the upper one begins
                top, remaining = add(full_name(name), top, remaining, lower, upper, share), none
        return top, remaining

    above = add(full_name("Reference"), None, none, "") if rig.reference else None
    if rig.root != "hips":
        above = add(full_name("root_node"), above, none, _ROOT_FOLLOWS[rig.root])
    pelvis, lower, upper, neck, head = centre.split()
    pelvis = add(full_name(pelvis), above, none, "pelvis")
    spine = SPINES.get(rig.family, f"{lower} {upper}").split()
    spine = [*spine[: rig.below + rig.between + rig.over + 1], spine[-1]] if "abdomen" not in rig.without else [upper]
    if "abdomen" in rig.without:
        chest = add(full_name(upper), pelvis, place["abdomen"] + place["chest"], "chest")
    else:
        top, remaining = chain(pelvis, spine[: rig.below], place["abdomen"], "pelvis", "abdomen")
        top = add(full_name(spine[rig.below]), top, remaining, "abdomen")
        names = spine[rig.below + 1 :]
        top, remaining = chain(top, names[: rig.between], place["chest"], "abdomen", "chest")
        top = add(full_name(names[rig.between]), top, remaining, "chest")
        chest, _ = chain(top, names[rig.between + 1 :], none, "chest", "chest")
    if "neck" not in rig.without:
        names = NECKS[rig.family].split() if rig.necks > 1 else [neck]
        top = add(full_name(names[0]), chest, 0.75 * place["head"], "head" if "head" in rig.without else "chest")
        for name in names[1:]:
            top = add(full_name(name), top, 0.1 * place["head"], "head" if "head" in rig.without else "chest")
        if "head" not in rig.without:
            top = add(full_name(head), top, (0.25 if rig.necks == 1 else 0.15) * place["head"], "head")
    elif "head" not in rig.without:
        top = add(full_name(head), chest, place["head"], "head")
    if rig.props and not {"neck", "head"} <= set(rig.without):
        add(full_name("HeadTop_End"), top, [0.0, 0.0, 0.18], "head")
        for side in ("Left", "Right"):
            add(full_name(f"{side}Eye"), top, [0.08, 0.03 if side == "Left" else -0.03, 0.07], "head")
        add(full_name("hair_01"), add(full_name("hair_00"), top, [-0.08, 0.0, 0.1], "head"), [-0.03, 0.0, -0.1], "head")
    for side, mark in zip(("left", "right"), sides.split(), strict=True):
        clavicle, *arm, thigh, shank, foot, toe = (full_name(limb.replace("@", mark)) for limb in limbs.split())

        def limb(top, at, names, parts, axis, side=side):
            """Add a chain of joints with twist joints within or beside its bones."""
            ends = [None, *(place[f"{side}_{part}"] for part in parts[1:])]
            for k, (name, part) in enumerate(zip(names, parts, strict=True)):
                if part in rig.without:  # its parent ends in a tip, if at all
                    rows[-1] = rows[-1]._replace(tip=ends[k])
                    break
                at = at if k == 0 else ends[k]
                has_twist = rig.twists and part in ("upper_arm", "forearm", "thigh", "shank")
                further = k + 1 < len(parts) and parts[k + 1] not in rig.without
                body = f"{side}_{part}"
                if has_twist and further:
                    # The joint itself does not twist with its bone: the twist joint does.
                    inner = add(name, top, at, body, "", 0.0, axis)
                    top = add(rig.twists.format(name), inner, ends[k + 1] / 2.0, body)
                    ends[k + 1] = ends[k + 1] / 2.0
                else:
                    top = inner = add(name, top, at, body)
                if rig.beside and further:
                    add(f"{name}TwistB", inner, ends[k + 1] * 0.4, body, "", 0.0, axis)
            return top

        attached_to, at = chest, place[f"{side}_clavicle"] + place[f"{side}_upper_arm"]
        if "clavicle" not in rig.without:
            attached_to = add(clavicle, chest, place[f"{side}_clavicle"], f"{side}_clavicle")
            at = place[f"{side}_upper_arm"]
        parts = ("upper_arm", "forearm", "hand")
        hand = limb(attached_to, at, arm, parts, 1)
        if rig.fingers and "hand" not in rig.without:
            out = 0.08 if side == "left" else -0.08
            for k, finger in enumerate(("Thumb", "Index", "Pinky")):
                base = add(f"{arm[2]}{finger}1", hand, [0.03 - 0.03 * k, out, 0.0], f"{side}_hand")
                add(f"{arm[2]}{finger}2", base, [0.0, out / 3, 0.0], f"{side}_hand")
        if rig.props and "hand" not in rig.without:
            add(full_name(f"Weapon_{mark}"), hand, [0.05, 0.0, 0.0], f"{side}_hand")
        attached_to, at = pelvis, place[f"{side}_thigh"]
        if rig.hips is not None:
            attached_to, at = add(full_name(f"{mark}_buttock"), pelvis, rig.hips * at, "pelvis"), (1.0 - rig.hips) * at
        ankle = limb(attached_to, at, (thigh, shank, foot), ("thigh", "shank", "foot"), 2)
        if not {"toe", "foot"} & set(rig.without):
            end = add(toe, ankle, rig.proportions.get("foot", 1.0) * np.array([0.12, 0.0, -0.05]), f"{side}_foot")
            if rig.props:
                add(f"{toe}_End", end, [0.05, 0.0, 0.0], f"{side}_foot")
    if rig.props and above:
        targets = add(full_name("ik_foot_root"), above, none, "")
        for mark in sides.split():
            add(full_name(f"ik_foot_{mark}"), targets, [0.1, 0.1, 0.0], "")
    return rows


def _zero_rotations(rig, rows, upright, rng):
    """D of every joint: its frame's orientation is R D, with R the rotation of its segment from the figure's rest."""
    first_bones = {}
    for joint in rows:
        if joint.parent is not None and np.linalg.norm(joint.place) > 1e-6:
            first_bones.setdefault(joint.parent, joint.place)
    zero_rotations = {}
    for name, _, _, body, *_ in rows:
        bone = first_bones.get(name, np.array([0.0, 0.0, 0.1]))
        zero_rotations[name] = Rotation.identity()
        if rig.zero == "random":
            zero_rotations[name] = Rotation.random(random_state=int(rng.integers(1 << 30)))
        elif rig.zero in ("along X", "along bones Y"):
            axis = np.eye(3)[0 if rig.zero == "along X" else 1]
            zero_rotations[name] = Rotation.align_vectors([bone / np.linalg.norm(bone)], [axis])[0]
        elif rig.zero == "legs up" and body.split("_")[-1] in ("thigh", "shank", "foot"):
            zero_rotations[name] = Rotation.from_euler("y", np.pi)
        elif rig.zero in ("A", "upright A") and any(part in body for part in ("upper_arm", "forearm", "hand")):
            zero_rotations[name] = Rotation.from_euler("x", np.pi / 4 if "left" in body else -np.pi / 4)
        if rig.zero.startswith("upright") and body not in ("", "moved"):
            zero_rotations[name] = zero_rotations[name] * upright.inv()
    return zero_rotations


def _body_rotations(rig, clip, to_file):
    """World rotations of everything that joints turn with."""
    local = clip.poses[:, 3:].reshape(clip.n_frames, -1, 4)
    world = local.copy()
    for index, segment in enumerate(SEGMENTS):
        if segment.parent >= 0:
            world[:, index] = quaternions.product(world[:, segment.parent], local[:, index])
    rotations = {body: to_file * Rotation.from_quat(world[:, k], scalar_first=True) for k, body in enumerate(BODIES)}
    ahead = quaternions.rotated(world[:, 0], np.array([1.0, 0.0, 0.0]))
    heading = Rotation.from_rotvec(np.arctan2(ahead[:, 1], ahead[:, 0])[:, None] * [0.0, 0.0, 1.0])
    still = Rotation.identity(clip.n_frames)
    return rotations | {"heading": to_file * heading, "shadow": to_file * heading, "moved": still, "": still}


def _euler(turned, order):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of gimbal lock: any of the solutions is right
        return turned.as_euler(order, degrees=True)


def write_rig(rig: Rig, clip, path: Path) -> None:
    """Write the clip's motion as a BVH of this rig."""
    rng = np.random.default_rng(rig.seed)
    up = np.array(UPS[rig.up], dtype=float)
    first = np.roll(up, 1)
    upright = Rotation.from_matrix(np.column_stack((first, np.cross(up, first), up)))
    to_file = upright * Rotation.from_euler("z", rig.turn)
    rows, rotations = _joints(rig), _body_rotations(rig, clip, to_file)
    zero_rotations = _zero_rotations(rig, rows, upright, rng)
    moved = to_file.apply(leg_scale(rig) * clip.poses[:, :3])
    hips = next(joint.name for joint in rows if joint.body == "pelvis")
    segments, frames, places = {}, {}, {}
    for name, parent, place, body, other, share, about, _ in rows:
        turned = rotations[body]
        if other:
            turned = turned * Rotation.from_rotvec(share * (turned.inv() * rotations[other]).as_rotvec())
        segments[name] = turned
        if about is not None:
            angle = 0.6 * np.sin(np.arange(clip.n_frames) / 17.0)
            turned = turned * Rotation.from_rotvec(np.outer(angle, np.eye(3)[about]))
        frames[name] = turned * zero_rotations[name]
        if name == hips or body in ("heading", "moved"):
            places[name] = moved
        elif body == "shadow":
            places[name] = moved - np.outer(moved @ up, up)
        else:
            places[name] = place * np.ones_like(moved)
            if parent is not None:
                places[name] = places[parent] + segments[parent].apply(place)
    _write(rig, clip, rows, zero_rotations, frames, places, rng, path)


def _write(rig, clip, rows, zero_rotations, frames, places, rng, path):
    lines, columns = ["HIERARCHY"], []

    def emit(joint, depth):
        tab, name, parent = "\t" * depth, joint.name, joint.parent
        relative = frames[name] if parent is None else frames[parent].inv() * frames[name]
        at = places[name] if parent is None else frames[parent].inv().apply(places[name] - places[parent])
        at = at / rig.unit
        moves = np.ptp(at, axis=0).max() > 1e-6 / rig.unit
        offset = np.zeros(3) if moves else at[0]
        lines.extend([f"{tab}{'JOINT' if depth else 'ROOT'} {name}", tab + "{"])
        lines.append(f"{tab}\tOFFSET " + " ".join(f"{value:.9f}" for value in offset))
        order = "".join(rng.permutation(list("XYZ"))) if rig.order == "any" else rig.order
        channels = [f"{axis}rotation" for axis in order]
        values = _euler(relative, order)
        if moves or rig.positions or parent is None:
            channels = ["Xposition", "Yposition", "Zposition", *channels]
            values = np.hstack([at, values])
        zero = np.zeros((rig.leading, len(channels)))
        zero[:, : len(channels) - 3] = offset[: len(channels) - 3]
        if rig.order == "any" and len(channels) == 6:  # positions behind the rotations, also in any order
            behind = [3, 4, 5, *rng.permutation(3)]
            channels, values, zero = [channels[k] for k in behind], values[:, behind], zero[:, behind]
        lines.append(f"{tab}\tCHANNELS {len(channels)} " + " ".join(channels))
        columns.append(np.vstack([zero, values]))
        children = [other for other in rows if other.parent == name]
        if rig.shuffled:
            children = [children[k] for k in rng.permutation(len(children))]
        for child in children:
            emit(child, depth + 1)
        if not children and rig.tips is not None:
            tip = (
                zero_rotations[name].inv().apply(rig.tips * joint.place if joint.tip is None else joint.tip) / rig.unit
            )
            lines.extend(
                [
                    f"{tab}\tEnd Site",
                    tab + "\t{",
                    f"{tab}\t\tOFFSET " + " ".join(f"{value:.6f}" for value in tip),
                    tab + "\t}",
                ]
            )
        lines.append(tab + "}")

    emit(rows[0], 0)
    table = np.hstack(columns)
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {1.0 / clip.fps:.{rig.time}f}"]
    lines += [" ".join(f"{value:.{rig.digits}f}" for value in row) for row in table]
    path.write_text("\n".join(lines) + "\n")


def at_rate(name, fps):
    clip = embedded(name)
    every = round(clip.fps / fps)
    return Clip(clip.poses[::every], clip.fps / every, name)


def largest_angle(first, second):
    first, second = global_rotations(first.poses), global_rotations(second.poses)
    assert first.shape == second.shape
    return np.rad2deg(np.linalg.norm(quaternions.logarithm(quaternions.product(quaternions.conjugate(first), second)),
                                     axis=2).max())  # fmt: skip
