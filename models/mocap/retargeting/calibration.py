r"""Anatomical calibration of a rig: constant rotations from its joint frames to the figure's segments.

A segment S of the figure differs by a constant rotation from the frame of its source joint J, R_S(t) = G_J(t) C_S,
whatever the rig's rest pose. As in the laboratory (Cappozzo et al. 1995, "anatomical frames"; Wu et al. 2002, 2005),
C_S comes from anatomical frames T_S(t) built of joint positions alone:

.. math:: C_S = \operatorname{mean}_t\, w(t)\, G_J(t)^{-1} T_S(t)

- pelvis, abdomen, chest: the hip line, the shoulder line or both, and the trunk line; w is large where trunk and
  thighs are most nearly in line, since there the spine is straight;
- upper and lower limbs: the bone, exactly, and for the twist about it the hinge axis, thigh × shank and upper arm ×
  forearm (w grows with the bend beyond 12°, since a straight limb has no plane); for a limb that is never bent, the
  axis of its parent;
- feet: the floor's vertical during stance, and the direction of the toes;
- the head is level on average; clavicles and hands, which many rigs do not define by positions, have on average the
  orientation of their parents.

Another set-up of the same rig (joint frames G_J D, another rest pose) changes C_S to D⁻¹ C_S, but not R_S.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from geometry import quaternions
from geometry.arrays import Array
from geometry.quaternions import unit
from models.humanoid.skeleton import BODIES, SEGMENTS, figure_model
from models.mocap.retargeting.body_lines import SIDES, BodyLines
from models.mocap.retargeting.segment_frames import frames, with_constant_offset
from models.mocap.retargeting.skeleton_roles import Roles, ancestry
from models.mocap.retargeting.sole_calibration import CalibratedFoot, calibrated_foot, foot_flat_frames

_Z = np.array([0.0, 0.0, 1.0])
# Standard deviation of the weight w over the angle between trunk and thighs: half the value turns the joints of 19
# captures by 1.2° RMS, twice by 0.8° (5.7 and 3.0° in one of them).
_STRAIGHTNESS_SD = np.deg2rad(20.0)
_MIN_BEND_SINE = np.sin(np.deg2rad(12.0))  # least bend that defines a plane: knees of straight legs bend by up to 12°
# Weight of the parent's axis relative to the hinge axis: that of a bend of 15°; half or twice turns joints by 0.3° RMS.
_PARENT_AXIS_WEIGHT = 0.01
# Inclination of the chest up to which the head is taken to be level: 25° turns the joints of a dance by 11° RMS, 80°
# those of four of 17 captures by up to 1.3°.
_MIN_UPRIGHT_COSINE = np.cos(np.deg2rad(50.0))
# Iterations for the trunk line: each leaves a third of the error, since the pelvis is a third of the line.
_ITERATION_COUNT = 5


class Calibration(NamedTuple):
    """A body on the figure's segments, in the file's axes.

    Attributes
    ----------
    segments : array of shape (n, 18, 4)
        R_S of the figure's segments; a segment without a source joint follows another one.
    bend : float
        Least angle between trunk and thighs [rad]: that of the straightest frame.
    feet : tuple of CalibratedFoot
        The left and the right foot.
    """

    segments: Array
    bend: float
    feet: tuple[CalibratedFoot, CalibratedFoot]


def calibrate(
    roles: Roles, parents: tuple[int, ...], lines: BodyLines, rotations: Array, up: Array, fps: float,
    rest_frame: int | None = None,
) -> Calibration:  # fmt: skip
    """Turn the joints' global rotations (n, joints, 4) into those of the figure's segments, in the file's axes.

    Parameters
    ----------
    roles : Roles
        Which joint plays which part.
    parents : tuple of int
        Parent of each joint.
    lines : BodyLines
        Anatomical positions.
    rotations : array of shape (n, joints, 4)
        Global rotations of the joints, relative to any rest pose.
    up : array of shape (3,)
        Vertical in the file's axes.
    fps : float
        Frame rate [1/s].
    rest_frame : int or None
        A frame in which the body stands upright with level feet; without one, frames are weighted as above.
    """
    body, (min_bend, straight) = _Body(roles, parents, rotations), _straightness(lines, rest_frame)
    # A pose that is repeated as padding counts once.
    weights = np.where(lines.padding(fps), 0.0, 1.0)
    straight = straight if rest_frame is not None else straight * weights
    _set_trunk(body, lines, straight)
    _set_head(body, up, straight)
    if lines.has_arms:
        has_clavicles = {"left_clavicle", "right_clavicle"} <= roles.segments.keys()
        _align_trunk(body.segments, unit(lines.trunk), _left_directions(lines)[1], has_clavicles)
        if "head" not in roles.segments:  # the head follows the chest, which has just been aligned
            body.set("head", body.segment("chest"))
    feet: list[CalibratedFoot] = []
    for k in range(len(SIDES)):
        _set_limbs(body, lines, k, weights)
        foot, shank = body.source(f"{SIDES[k]}_foot"), body.segment(f"{SIDES[k]}_shank")
        if foot is None:
            feet.append(CalibratedFoot(shank, 0, has_heading=False, toe_pitch=np.nan))
        else:
            flat = foot_flat_frames(lines, k, foot, up, fps) if rest_frame is None else np.array([rest_frame])
            toes, single = (lines.toes - lines.ankles)[:, k], rest_frame is None and lines.is_single_pose
            feet.append(calibrated_foot(foot, toes, shank, up, flat, straight, single))
        body.set(f"{SIDES[k]}_foot", feet[k].rotations)
    return Calibration(body.segments, min_bend, (feet[0], feet[1]))


class _Body:
    """Rotations of the figure's segments (n, 18, 4), filled in one by one, and those of the file's joints."""

    def __init__(self, roles: Roles, parents: tuple[int, ...], rotations: Array) -> None:
        self.segments = np.empty((len(rotations), len(SEGMENTS), 4))
        self.roles, self._parents, self._rotations = roles, parents, rotations

    def set(self, body: str, rotations: Array) -> None:
        """Set the rotations of a segment."""
        self.segments[:, BODIES.index(body)] = rotations

    def segment(self, body: str) -> Array:
        """Rotations of a segment that was set."""
        return self.segments[:, BODIES.index(body)]

    def source(self, body: str) -> Array | None:
        """Global rotations of a segment's source: the last joint before its end, since twist joints may lie between."""
        index = self.roles.segments.get(body)
        if index is None:
            return None
        end = self.roles.ends.get(body)
        if end is not None and index in ancestry(self._parents[end], self._parents):
            index = self._parents[end]
        return self._rotations[:, index]


def _straightness(lines: BodyLines, rest_frame: int | None) -> tuple[float, Array]:
    """Least angle between trunk and thighs [rad], and weights (n,) that fall as a frame's angle exceeds it."""
    trunk, thighs = unit(lines.trunk), unit(unit(lines.knees - lines.hips).sum(axis=1))
    bend = np.arccos(np.clip(-np.sum(trunk * thighs, axis=1), -1.0, 1.0))
    min_bend = float(np.min(bend, where=np.isfinite(bend), initial=np.pi))
    if rest_frame is not None:
        weights = np.zeros(len(bend))
        weights[rest_frame] = 1.0
        return min_bend, weights
    return min_bend, np.exp(-(((np.nan_to_num(bend, nan=np.pi) - min_bend) / _STRAIGHTNESS_SD) ** 2) / 2.0)


def _left_directions(lines: BodyLines) -> tuple[Array, Array]:
    """Directions to the left of the hips and of the shoulders; without arms, of the hips twice."""
    hips = unit(lines.left)
    return hips, unit(lines.shoulders[:, 0] - lines.shoulders[:, 1]) if lines.has_arms else hips


def _set_trunk(body: _Body, lines: BodyLines, straight: Array) -> None:
    """Pelvis, abdomen, chest and clavicles: along the trunk line and across hips and shoulders, on average."""
    trunk, (hips, shoulders), own_trunk = (
        unit(lines.trunk),
        _left_directions(lines),
        _figure_trunk_frame(lines.has_arms),
    )
    for name, left in (("pelvis", hips), ("abdomen", unit(hips + shoulders)), ("chest", shoulders)):
        source = body.source(name)
        if source is None:
            body.set(name, body.segment("pelvis"))
            continue
        target = quaternions.product(frames(left, trunk), quaternions.conjugate(own_trunk))
        rotations = with_constant_offset(source, target, straight)
        if name == "pelvis":
            # In rigs with extra hip joints beside the pelvis, the hip line turns relative to the pelvis.
            side = quaternions.rotated(rotations, np.array([0.0, 1.0, 0.0]))
            rotations = quaternions.product(quaternions.arcs(side, hips), rotations)
        body.set(name, rotations)
    if "abdomen" not in body.roles.segments:
        body.set("abdomen", quaternions.slerped(body.segment("pelvis"), body.segment("chest"), 0.5))
    chest = body.segment("chest")
    for name in ("left_clavicle", "right_clavicle"):
        source = body.source(name)
        body.set(name, chest if source is None else with_constant_offset(source, chest, straight))


def _set_head(body: _Body, up: Array, straight: Array) -> None:
    """The head: level on average over the upright frames, with the heading of the chest.

    People keep the eyes level whatever the trunk does (Pozzo et al. 1990). The head of a body that is never upright
    has the orientation of the chest on average.
    """
    source, chest = body.source("head"), body.segment("chest")
    if source is None:
        body.set("head", chest)
        return
    upright = straight * (quaternions.rotated(chest, _Z) @ up > _MIN_UPRIGHT_COSINE)
    if upright.sum() < 1e-6:
        body.set("head", with_constant_offset(source, chest, straight))
        return
    left = quaternions.rotated(chest, np.array([0.0, 1.0, 0.0]))
    left = unit(left - (left @ up)[:, None] * up)
    body.set("head", with_constant_offset(source, frames(left, np.broadcast_to(up, left.shape)), upright))


def _set_limbs(body: _Body, lines: BodyLines, k: int, weights: Array) -> None:
    """Arm, hand and leg of a side, from the bones and hinge axes in `lines`."""
    side, sign = SIDES[k], 1.0 - 2.0 * k
    elbow, knee = -sign * lines.elbow_normals()[:, k], lines.knee_normals()[:, k]
    # A knee that bends back is a fault of the capture, and no evidence of where the leg faces.
    knee = np.where(np.sum(knee * lines.left, axis=1, keepdims=True) < 0.0, 0.0, knee)
    bones = (
        (f"{side}_clavicle", f"{side}_upper_arm", lines.shoulders, lines.elbows, elbow, (1, sign), 2),
        (f"{side}_upper_arm", f"{side}_forearm", lines.elbows, lines.wrists, elbow, (1, sign), 2),
        ("pelvis", f"{side}_thigh", lines.hips, lines.knees, knee, (2, -1.0), 1),
        (f"{side}_thigh", f"{side}_shank", lines.knees, lines.ankles, knee, (2, -1.0), 1),
    )
    for parent, name, start, end, hinge, along, across in bones:
        body.set(
            name,
            _limb_rotations(
                body.source(name), (end - start)[:, k], hinge, body.segment(parent), along, across, weights
            ),
        )
    hand, forearm = body.source(f"{side}_hand"), body.segment(f"{side}_forearm")
    body.set(f"{side}_hand", forearm if hand is None else with_constant_offset(hand, forearm, weights))


def _figure_trunk_frame(has_arms: bool) -> Array:
    """Frame of the figure's own trunk line in the rest pose, built like a source's by `frames`."""
    model = figure_model()
    top = model.body("abdomen").pos + model.body("chest").pos
    top = top + (model.body("left_clavicle").pos + model.body("left_upper_arm").pos if has_arms else 0.0)
    return frames(np.array([[0.0, 1.0, 0.0]]), unit(np.array([[top[0], 0.0, top[2]]])))[0]


def _align_trunk(segments: Array, trunk: Array, shoulders: Array, has_clavicles: bool) -> None:
    """Align the figure's trunk and shoulder lines with the source's, whose spine has joints in other places.

    Abdomen, chest and clavicles turn together by some degrees, more where the spine bends; then the clavicles turn, if
    the source has them. The head keeps its orientation. Changes `segments` in place.
    """
    model = figure_model()
    abdomen, chest = model.body("abdomen").pos, model.body("chest").pos
    sides = [BODIES.index(f"{side}_clavicle") for side in SIDES]
    carried = [BODIES.index(body) for body in ("abdomen", "chest")] + sides
    for _ in range(_ITERATION_COUNT):
        ends = [
            quaternions.rotated(segments[:, 2], model.body(BODIES[clavicle]).pos)
            + quaternions.rotated(segments[:, clavicle], model.body(f"{side}_upper_arm").pos)
            for side, clavicle in zip(SIDES, sides, strict=True)
        ]
        own = quaternions.rotated(segments[:, 0], abdomen) + quaternions.rotated(segments[:, 1], chest)
        own = unit(own + (ends[0] + ends[1]) / 2.0)
        turn = quaternions.arcs(own, np.where(np.isnan(trunk), own, trunk))
        segments[:, carried] = quaternions.product(turn[:, None], segments[:, carried])
        if not has_clavicles:
            continue
        own = quaternions.rotated(turn, unit(ends[0] - ends[1]))
        turn = quaternions.arcs(own, np.where(np.isnan(shoulders), own, shoulders))
        segments[:, sides] = quaternions.product(turn[:, None], segments[:, sides])


def _limb_rotations(
    source: Array | None, bone: Array, hinge: Array, parent: Array, along: tuple[int, float], across: int,
    weights: Array,
) -> Array:  # fmt: skip
    """R of a limb's segment: axis `along` is on its bone in every frame, axis `across` on its hinge on average.

    The average is weighted by `weights` (n,).
    """
    axis, sign = along
    if np.isnan(bone).any():
        return parent if source is None else with_constant_offset(source, parent, weights)
    bone = unit(bone)
    straight = quaternions.product(quaternions.arcs(sign * quaternions.rotated(parent, np.eye(3)[axis]), bone), parent)
    parent_axis = quaternions.rotated(straight, np.eye(3)[across])
    sine = np.linalg.norm(hinge, axis=1, keepdims=True)
    evidence = weights[:, None] * (
        np.nan_to_num(hinge * np.maximum(sine - _MIN_BEND_SINE, 0.0)) + _PARENT_AXIS_WEIGHT * parent_axis
    )
    if source is None:
        return straight
    inverse = quaternions.conjugate(source)
    long = unit(weights @ quaternions.rotated(inverse, bone))
    lateral = quaternions.rotated(inverse, evidence).sum(axis=0)
    lateral = unit(lateral - long * (lateral @ long))
    columns = np.empty((3, 3))
    columns[:, axis], columns[:, across] = sign * long, lateral
    third = 3 - axis - across
    columns[:, third] = np.cross(columns[:, (third + 1) % 3], columns[:, (third + 2) % 3])
    rotations = quaternions.product(source, np.asarray(Rotation.from_matrix(columns).as_quat(scalar_first=True)))
    # In files that stretch bones, or bend them at intermediate joints, bones turn relative to the joint frames.
    return quaternions.product(
        quaternions.arcs(sign * quaternions.rotated(rotations, np.eye(3)[axis]), bone), rotations
    )
