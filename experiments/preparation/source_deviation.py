r"""Deviation of a motion on the figure from the file it was read from: directions of segments, positions of joints.

The joints of the file are positioned by plain forward kinematics of its own skeleton. Its vertical is turned up, and
its heading is the best fit. No rotation from the calibration is used, and the removal of a floor's slope counts as a
deviation; only the vertical, the scale of the path and the height of the floor come from the retargeting. With the
lines d of a body (trunk, hips, shoulders, arms, legs and feet) in figure and file, the direction of a segment s
deviates by

.. math:: \theta_s = \operatorname{median}_t \angle(d_s(t), d'_s(t)) .

The file is scaled to the figure's limbs: each of its lines by the ratio of the median lengths, and the path of its hips
by that of the legs. The joints p′ of these lines, aligned with the figure's by the best planar displacement, are

.. math:: e_j = \operatorname{median}_t |p_j(t) - p'_j(t)|

away from the figure's. How far the toes of a file lie below its ankles differs from rig to rig, so feet are compared up
to a constant pitch: whether they lie flat is measured by the soles in stance.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from geometry import quaternions
from geometry.arrays import Array
from geometry.quaternions import unit
from models.humanoid.skeleton import BODIES
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import global_rotations, segment_positions
from models.mocap.preparation.fidelity import common_frames
from models.mocap.preparation.prepare import Prepared
from models.mocap.readers.formats import read_motion
from models.mocap.retargeting.body_lines import SIDES, body_lines
from models.mocap.retargeting.retarget_report import RetargetReport
from models.mocap.retargeting.skeleton_roles import roles_of

_LIMBS = tuple(f"{side}_{limb}" for side in SIDES for limb in ("upper_arm", "forearm", "thigh", "shank"))
LINES = ("trunk", "hips", "shoulders", *_LIMBS, *(f"{side}_foot" for side in SIDES))
PLACES = tuple(f"{side}_{joint}" for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist") for side in SIDES)
_FEET = [BODIES.index(f"{side}_foot") for side in SIDES]
_X = np.array([1.0, 0.0, 0.0])


class Source(NamedTuple):
    """The body of a file, frame by frame of the clip that was retargeted from it.

    Attributes
    ----------
    directions : array of shape (n, 13, 3)
        Unit vectors along `LINES`, z up; NaN if the skeleton does not have them.
    places : array of shape (n, 12, 3)
        `PLACES` of the body scaled to the figure's limbs, z up [m].
    middle : array of shape (n, 3)
        Middle of the hips [m].
    """

    directions: Array
    places: Array
    middle: Array


class Deviation(NamedTuple):
    """How far a motion is from its file.

    Attributes
    ----------
    direction : float
        Largest deviation of a segment's direction, median over time [rad].
    segment : str
        The segment that deviates most.
    place : float
        Largest distance of a joint from its place, median over time [m].
    joint : str
        The joint that is furthest.
    """

    direction: float
    segment: str
    place: float
    joint: str


def source_of(path: Path, captured: Clip, report: RetargetReport) -> Source:
    """The body in the file from which a clip was retargeted without hints."""
    motion = read_motion(path)
    roles = roles_of(motion.joints, motion.parents)
    assert not isinstance(roles, str)  # otherwise it would not have been retargeted
    rotations = motion.global_rotations()
    lines = body_lines(motion, roles, motion.global_positions(rotations), rotations)
    frames, up = slice(report.dropped, report.dropped + captured.n_frames), _rotation_up(report.up)
    joints = (lines.hips, lines.knees, lines.ankles, lines.shoulders, lines.elbows, lines.wrists)
    middle, vectors, toes = (
        quaternions.rotated(up, part[frames])
        for part in (lines.middle, _line_vectors(*joints), lines.toes - lines.ankles)
    )
    places, own, feet = _figure_lines(captured.poses)
    heading = _best_heading(unit(own), unit(vectors))
    middle, vectors, toes = (quaternions.rotated(heading, part) for part in (middle, vectors, toes))
    for k, side in enumerate(SIDES):
        joint = roles.segments.get(f"{side}_foot")
        if joint is not None and np.isnan(toes[:, k]).any():
            toes[:, k] = _foot_direction(
                quaternions.product(quaternions.product(heading, up), rotations[frames, joint]), feet[:, k]
            )
    scales = np.median(np.linalg.norm(own, axis=2), axis=0) / np.median(np.linalg.norm(vectors, axis=2), axis=0)
    middle = report.scale * (middle - middle.mean(axis=0)) + places.mean(axis=0)
    directions = np.concatenate((unit(vectors), _without_pitch(unit(toes), feet)), axis=1)
    return Source(directions, _joint_places(middle, scales[:, None] * vectors), middle)


def deviations(path: Path, prepared: Prepared) -> tuple[Deviation, Deviation] | None:
    """Deviation of a capture as retargeted and as prepared from its file; None for files on the figure's skeleton."""
    if prepared.report is None:
        return None
    captured, pace = prepared.captured, prepared.paced.pace
    source = source_of(path, captured, prepared.report)
    seconds = np.arange(captured.n_frames) / (captured.fps * pace)
    clip_frames, capture_frames = common_frames(prepared.clip, captured, prepared.looped, pace)
    rate, last = prepared.clip.fps, capture_frames.stop - 1
    compared_frames = (capture_frames.start <= seconds * rate + 1e-6) & (seconds * rate <= last + 1e-6)
    times = seconds[compared_frames] + (clip_frames.start - capture_frames.start) / rate
    poses = CubicSpline(np.arange(prepared.clip.n_frames) / rate, prepared.clip.poses)(times)
    compared = Source(*(part[compared_frames] for part in source))
    return deviation(source, captured.poses), deviation(compared, Clip(poses, rate, prepared.clip.name).poses)


def deviation(source: Source, poses: Array) -> Deviation:
    """Deviation of poses of the figure, shape (n, 75), from a body in the same frames."""
    middle, vectors, feet = _figure_lines(poses)
    own = np.concatenate((unit(vectors), quaternions.rotated(feet, _X)), axis=1)
    heading = _best_heading(own, source.directions)
    chords = np.linalg.norm(own - quaternions.rotated(heading, source.directions), axis=2)
    angles = _medians(2.0 * np.arcsin(np.clip(chords / 2.0, 0.0, 1.0)))
    shift = (middle - quaternions.rotated(heading, source.middle)).mean(axis=0) * (1.0, 1.0, 0.0)
    moved = quaternions.rotated(heading, source.places) + shift
    distances = _medians(np.linalg.norm(_joint_places(middle, vectors) - moved, axis=2))
    segment, joint = int(np.argmax(angles)), int(np.argmax(distances))
    return Deviation(float(angles[segment]), LINES[segment], float(distances[joint]), PLACES[joint])


def _rotation_up(up: str) -> Array:
    """Rotation that turns an axis of a file, such as ``+Y``, up."""
    axis = np.eye(3)["XYZ".index(up[1])] * (1.0 if up[0] == "+" else -1.0)
    return quaternions.arcs(axis[None], np.array([[0.0, 0.0, 1.0]]))[0]


def _best_heading(own: Array, others: Array) -> Array:
    """Rotation about the vertical that turns vectors of shape (n, k, 3) as nearly as possible into others."""
    own_level, others_level = own @ (1, 1j, 0), others @ (1, 1j, 0)
    return quaternions.about_axis(2, np.array(np.angle(np.nansum(others_level.conj() * own_level))))


def _figure_lines(poses: Array) -> tuple[Array, Array, Array]:
    """Middle of the figure's hips, its lines, and rotations of its feet; shapes (n, 3), (n, 11, 3), (n, 2, 4)."""
    rotations = global_rotations(poses)
    places = segment_positions(poses[:, :3], rotations)
    joints = [
        np.stack([places[:, BODIES.index(f"{side}_{part}")] for side in SIDES], axis=1)
        for part in ("thigh", "shank", "foot", "upper_arm", "forearm", "hand")
    ]
    return joints[0].mean(axis=1), _line_vectors(*joints), rotations[:, _FEET]


def _line_vectors(hips: Array, knees: Array, ankles: Array, shoulders: Array, elbows: Array, wrists: Array) -> Array:
    """All of `LINES` but the feet, with their lengths, from joints of shape (n, 2, 3); shape (n, 11, 3)."""
    trunk = shoulders.mean(axis=1) - hips.mean(axis=1)
    limbs = (elbows - shoulders, wrists - elbows, knees - hips, ankles - knees)
    across = [line[:, 0] - line[:, 1] for line in (hips, shoulders)]
    return np.stack((trunk, *across, *(limb[:, k] for k in range(len(SIDES)) for limb in limbs)), axis=1)


def _joint_places(middle: Array, vectors: Array) -> Array:
    """`PLACES` at the ends of lines, shape (n, 12, 3)."""
    trunk, across, shoulders, *limbs = np.moveaxis(vectors, 1, 0)
    found: list[tuple[Array, ...]] = []
    for k, sign in enumerate((0.5, -0.5)):
        arm, forearm, thigh, shank = limbs[4 * k : 4 * k + 4]
        hip, shoulder = middle + sign * across, middle + trunk + sign * shoulders
        found.append((hip, hip + thigh, hip + thigh + shank, shoulder, shoulder + arm, shoulder + arm + forearm))
    return np.stack([place for both in zip(*found, strict=True) for place in both], axis=1)


def _foot_direction(joint: Array, foot: Array) -> Array:
    """Direction of a foot without toes: fixed to its joint, and that of the figure's foot in the median, (n, 3)."""
    local = quaternions.rotated(quaternions.conjugate(joint), quaternions.rotated(foot, _X))
    return quaternions.rotated(joint, np.median(local, axis=0))


def _without_pitch(feet: Array, turned: Array) -> Array:
    """Directions (n, 2, 3), pitched in the figure's feet so that in the median they have no pitch to their x axes."""
    local = quaternions.rotated(quaternions.conjugate(turned), feet)
    pitch = np.nanmedian(np.arctan2(-local[..., 2], local[..., 0]), axis=0) if np.isfinite(local).any() else np.zeros(2)
    return quaternions.rotated(turned, quaternions.rotated(quaternions.about_axis(1, -pitch), local))


def _medians(measures: Array) -> Array:
    """Medians over time, shape (n, k) → (k,); −1 where there is no measure."""
    measured = np.isfinite(measures).any(axis=0)
    medians = np.full(measures.shape[1], -1.0)
    medians[measured] = np.nanmedian(measures[:, measured], axis=0)
    return medians
