"""Skeletons of other creatures, and of humans with tails, skirts or wings: chains of joints that sway as sines."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from models.mocap.readers.source_motion import SourceMotion


def lone_root(n_frames: int = 120) -> SourceMotion:
    """A joint at rest, 1 m above the origin, at 30 frames a second [cm]."""
    unturned = np.zeros((n_frames, 1, 4))
    unturned[..., 0] = 1.0
    places = np.tile([0.0, 100.0, 0.0], (n_frames, 1, 1))
    nowhere = np.zeros((1, 3))
    return SourceMotion(Path("x.bvh"), ("root",), (-1,), nowhere, nowhere, unturned, places, 30.0, None)


def grow(
    motion: SourceMotion, at: str, offsets, sway=0.4, axis=(1.0, 0.0, 0.0), phase=0.0, name="extra"
) -> SourceMotion:
    """The motion with a chain of further joints on joint `at`, each of which sways about an axis by `sway` [rad]."""
    for k, offset in enumerate(offsets):
        angles = sway * np.sin(np.arange(motion.n_frames) / 9.0 + phase + k)
        turns = Rotation.from_rotvec(np.outer(angles, axis)).as_quat(scalar_first=True)[:, None]
        place = np.array(offset, dtype=float)
        motion = replace(
            motion,
            joints=(*motion.joints, f"{name}{k}"),
            parents=(*motion.parents, motion.joints.index(at)),
            offsets=np.vstack((motion.offsets, place)),
            tips=np.vstack((motion.tips, np.zeros(3))),
            rotations=np.concatenate((motion.rotations, turns), axis=1),
            translations=np.concatenate((motion.translations, np.tile(place, (motion.n_frames, 1, 1))), axis=1),
        )
        at = f"{name}{k}"
    motion.tips[-1] = offsets[-1]
    return motion


def grow_both(motion: SourceMotion, at: str, offsets, **more) -> SourceMotion:
    """The motion with a chain to the left and its mirror image in x."""
    motion = grow(motion, at, offsets, name="one", **more)
    return grow(motion, at, [(-x, y, z) for x, y, z in offsets], name="other", phase=np.pi, **more)


def without(motion: SourceMotion, *joints: str) -> SourceMotion:
    """The motion without some joints and all below them."""
    gone = set[int]()
    for k, parent in enumerate(motion.parents):
        if parent in gone or motion.joints[k] in joints:
            gone.add(k)
    return motion.of_joints([k for k in range(len(motion.joints)) if k not in gone])


def quadruped(hind: tuple[float, float, float], fore: tuple[float, float, float], trunk: float) -> SourceMotion:
    """An animal with legs of three bones [cm], collar bones, a neck and a tail, that walks on the spot."""
    motion = grow(lone_root(), "root", [(0, 5, trunk / 2), (0, 0, trunk / 2)], 0.05, name="spine")
    for side, x in (("L", 10.0), ("R", -10.0)):
        phase = np.pi * (side == "R")
        leg = [(x, -5, 0), (0, -hind[0], 8), (0, -hind[1], -12), (0, -hind[2], 2), (0, -3, 6)]
        arm = [(x / 2, 2, 5), (x, -5, 0), (0, -fore[0], -8), (0, -fore[1], 6), (0, -fore[2], 0), (0, -3, 5)]
        motion = grow(motion, "root", leg, 0.5, phase=phase, name=f"hind{side}")
        motion = grow(motion, "spine1", arm, 0.5, phase=np.pi - phase, name=f"fore{side}")
    motion = grow(motion, "spine1", [(0, 20, 20), (0, 15, 15), (0, 0, 15)], 0.2, name="neck")
    return grow(motion, "root", [(0, 0, -15)] * 3, 0.3, axis=(0.0, 1.0, 0.0), name="tail")


def radial(n_legs: int) -> SourceMotion:
    """A spider, or a sea urchin: legs of two bones all around the root."""
    motion = lone_root()
    for k in range(n_legs):
        x, z = np.cos(2.0 * np.pi * k / n_legs), np.sin(2.0 * np.pi * k / n_legs)
        leg = [(10 * x, 0, 10 * z), (20 * x, 20, 20 * z), (10 * x, -40, 10 * z)]
        motion = grow(motion, "root", leg, 0.3, phase=k, name=f"leg{k}_")
    return motion


def with_fingers(motion: SourceMotion, wrist: str) -> SourceMotion:
    """The motion with a hand of five fingers that grip."""
    for k, x in enumerate((-4.0, -2.0, 0.0, 2.0, 4.0)):
        finger = [(x, 0, 9), (0, 0, 4), (0, 0, 3), (0, 0, 2)]
        motion = grow(motion, wrist, finger, 0.5, phase=0.3 * k, name=f"{wrist}_finger{k}_")
    return motion


def arms_with_hands() -> SourceMotion:
    """Two arms with fingers at one joint, as of somebody who sits at a table."""
    motion = grow_both(lone_root(), "root", [(15, 0, 0), (0, -28, 0), (0, -25, 0)])
    return with_fingers(with_fingers(motion, "one2"), "other2")


def with_skirt(motion: SourceMotion, hips: str, n_strands: int, lengths: tuple[float, float]) -> SourceMotion:
    """The motion with strands of two bones all around the hips, downwards along z."""
    for k in range(n_strands):
        x, y = 10.0 * np.cos(2.0 * np.pi * k / n_strands), 10.0 * np.sin(2.0 * np.pi * k / n_strands)
        strand = [(x, y, 0), *((0, 0, -length) for length in lengths)]
        motion = grow(motion, hips, strand, 0.25, phase=k, name=f"strand{k}_")
    return motion


def twice(motion: SourceMotion, distance: float) -> SourceMotion:
    """The motion and a copy of it beside, below the same root."""
    n = len(motion.joints)
    joints = (*motion.joints, *(f"copy of {joint}" for joint in motion.joints))
    parents = (*motion.parents, *(max(parent + n, 0) if parent >= 0 else 0 for parent in motion.parents))
    translations = np.concatenate([motion.translations] * 2, axis=1)
    translations[:, n] = (distance, 0.0, 0.0)
    return replace(
        motion,
        joints=joints,
        parents=parents,
        offsets=np.vstack([motion.offsets] * 2),
        tips=np.vstack([motion.tips] * 2),
        rotations=np.concatenate([motion.rotations] * 2, axis=1),
        translations=translations,
    )
