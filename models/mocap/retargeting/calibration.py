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

Another set-up of the same rig (joint frames G_J D, another rest pose) changes C_S to D⁻¹ C_S, and R_S not at all.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from models.arrays import Array
from models.humanoid.skeleton import BODIES, SEGMENTS, figure_model
from models.mocap.motion import quaternions
from models.mocap.retargeting.body_lines import SIDES, BodyLines, unit
from models.mocap.retargeting.segment_frames import carried, frames
from models.mocap.retargeting.skeleton_roles import Roles, ancestry
from models.mocap.retargeting.sole_calibration import calibrated_foot, flat_frames

_Z = np.array([0.0, 0.0, 1.0])
# Standard deviation of the weight w over the angle between trunk and thighs: half of it turns the joints of 19
# captures by 1.2° RMS, twice by 0.8° (5.7 and 3.0° in one of them).
_STRAIGHT = np.deg2rad(20.0)
_BEND = np.sin(np.deg2rad(12.0))  # least bend that defines a plane: knees of straight legs are up to 12° off the line
# Weight of the parent's axis beside the hinge axis: that of a bend by 15°; half or twice turns joints by 0.3° RMS.
_UNBENT = 0.01
# Inclination of the chest up to which a head can be level: 25° turns the joints of a dance by 11° RMS, 80° those of
# four of 17 captures by up to 1.3°.
_UPRIGHT = np.cos(np.deg2rad(50.0))
_ROUNDS = 5  # iterations for the trunk line: each leaves a third of the error, as the pelvis is a third of the line


class Calibration(NamedTuple):
    """A body on the figure's segments, in the file's axes.

    Attributes
    ----------
    segments : array of shape (n, 18, 4)
        R_S of the figure's segments; a segment without a source joint follows another one.
    bend : float
        Least angle between trunk and thighs [rad]: that of the straightest frame.
    stances : tuple of int
        Number of frames from which the left and the right sole were calibrated.
    """

    segments: Array
    bend: float
    stances: tuple[int, int]


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
    body, (least, straight) = _Body(roles, parents, rotations), _straightness(lines, rest_frame)
    # A pose that is held, as programs fill a motion up, counts once.
    counted = np.where(lines.filled(fps), 0.0, 1.0)
    straight = straight if rest_frame is not None else straight * counted
    _put_trunk(body, lines, straight)
    _put_head(body, up, straight)
    if lines.has_arms:
        clavicled = {"left_clavicle", "right_clavicle"} <= roles.segments.keys()
        _set_lines(body.segments, unit(lines.trunk), _across(lines)[1], clavicled)
        if "head" not in roles.segments:  # it goes with the chest, as that is now
            body.put("head", body.of("chest"))
    counts: list[int] = []
    for k in range(len(SIDES)):
        _put_limbs(body, lines, k, counted)
        foot = body.joint(f"{SIDES[k]}_foot")
        if foot is None:
            body.put(f"{SIDES[k]}_foot", body.of(f"{SIDES[k]}_shank"))
            counts.append(0)
            continue
        flat = flat_frames(lines, k, foot, up, fps) if rest_frame is None else np.array([rest_frame])
        shank = body.of(f"{SIDES[k]}_shank")
        sole, used = calibrated_foot(foot, (lines.toes - lines.ankles)[:, k], shank, up, flat, straight)
        body.put(f"{SIDES[k]}_foot", sole)
        counts.append(used)
    return Calibration(body.segments, least, (counts[0], counts[1]))


class _Body:
    """Rotations of the figure's segments (n, 18, 4) as they are found, and those of the file's joints."""

    def __init__(self, roles: Roles, parents: tuple[int, ...], rotations: Array) -> None:
        self.segments = np.empty((len(rotations), len(SEGMENTS), 4))
        self.roles, self._parents, self._rotations = roles, parents, rotations

    def put(self, body: str, turned: Array) -> None:
        """Set the rotations of a segment."""
        self.segments[:, BODIES.index(body)] = turned

    def of(self, body: str) -> Array:
        """Rotations of a segment that was put."""
        return self.segments[:, BODIES.index(body)]

    def joint(self, body: str) -> Array | None:
        """Global rotations of a segment's source: the last joint before its end, since twist joints may lie between."""
        index = self.roles.segments.get(body)
        if index is None:
            return None
        end = self.roles.ends.get(body)
        if end is not None and index in ancestry(self._parents[end], self._parents):
            index = self._parents[end]
        return self._rotations[:, index]


def _straightness(lines: BodyLines, rest_frame: int | None) -> tuple[float, Array]:
    """Least angle between trunk and thighs [rad], and the weight (n,) of each frame by how near it is to that."""
    trunk, thighs = unit(lines.trunk), unit(unit(lines.knees - lines.hips).sum(axis=1))
    bend = np.arccos(np.clip(-np.sum(trunk * thighs, axis=1), -1.0, 1.0))
    least = float(np.min(bend, where=np.isfinite(bend), initial=np.pi))
    if rest_frame is not None:
        straight = np.zeros(len(bend))
        straight[rest_frame] = 1.0
        return least, straight
    return least, np.exp(-(((np.nan_to_num(bend, nan=np.pi) - least) / _STRAIGHT) ** 2) / 2.0)


def _across(lines: BodyLines) -> tuple[Array, Array]:
    """Directions to the left of the hips and of the shoulders; without arms, of the hips twice."""
    hips = unit(lines.left)
    return hips, unit(lines.shoulders[:, 0] - lines.shoulders[:, 1]) if lines.has_arms else hips


def _put_trunk(body: _Body, lines: BodyLines, straight: Array) -> None:
    """Pelvis, abdomen, chest and clavicles: along the trunk line and across hips and shoulders, on average."""
    trunk, (hips, shoulders), own_trunk = unit(lines.trunk), _across(lines), _own_trunk(lines.has_arms)
    for name, left in (("pelvis", hips), ("abdomen", unit(hips + shoulders)), ("chest", shoulders)):
        source = body.joint(name)
        if source is None:
            body.put(name, body.of("pelvis"))
            continue
        wanted = quaternions.product(frames(left, trunk), quaternions.conjugate(own_trunk))
        turned = carried(source, wanted, straight)
        if name == "pelvis":
            # In rigs with extra hip joints beside the pelvis, the hip line turns relative to the pelvis.
            side = quaternions.rotated(turned, np.array([0.0, 1.0, 0.0]))
            turned = quaternions.product(quaternions.arcs(side, hips), turned)
        body.put(name, turned)
    if "abdomen" not in body.roles.segments:
        body.put("abdomen", quaternions.slerped(body.of("pelvis"), body.of("chest"), 0.5))
    chest = body.of("chest")
    for name in ("left_clavicle", "right_clavicle"):
        source = body.joint(name)
        body.put(name, chest if source is None else carried(source, chest, straight))


def _put_head(body: _Body, up: Array, straight: Array) -> None:
    """The head: on average of the upright frames level, with the heading of the chest.

    People keep the eyes level whatever the trunk does (Pozzo et al. 1990). The head of a body that is never upright
    has the orientation of the chest on average.
    """
    source, chest = body.joint("head"), body.of("chest")
    if source is None:
        body.put("head", chest)
        return
    upright = straight * (quaternions.rotated(chest, _Z) @ up > _UPRIGHT)
    if upright.sum() < 1e-6:
        body.put("head", carried(source, chest, straight))
        return
    left = quaternions.rotated(chest, np.array([0.0, 1.0, 0.0]))
    left = unit(left - (left @ up)[:, None] * up)
    body.put("head", carried(source, frames(left, np.broadcast_to(up, left.shape)), upright))


def _put_limbs(body: _Body, lines: BodyLines, k: int, counted: Array) -> None:
    """Arm, hand and leg of a side, whose bones and hinges the lines show."""
    side, sign = SIDES[k], 1.0 - 2.0 * k
    elbow, knee = -sign * lines.elbow_normals()[:, k], lines.knee_normals()[:, k]
    bones = (
        (f"{side}_clavicle", f"{side}_upper_arm", lines.shoulders, lines.elbows, elbow, (1, sign), 2),
        (f"{side}_upper_arm", f"{side}_forearm", lines.elbows, lines.wrists, elbow, (1, sign), 2),
        ("pelvis", f"{side}_thigh", lines.hips, lines.knees, knee, (2, -1.0), 1),
        (f"{side}_thigh", f"{side}_shank", lines.knees, lines.ankles, knee, (2, -1.0), 1),
    )
    for parent, name, start, end, hinge, along, across in bones:
        body.put(name, _limb(body.joint(name), (end - start)[:, k], hinge, body.of(parent), along, across, counted))
    hand, forearm = body.joint(f"{side}_hand"), body.of(f"{side}_forearm")
    body.put(f"{side}_hand", forearm if hand is None else carried(hand, forearm, counted))


def _own_trunk(has_arms: bool) -> Array:
    """Frame of the figure's own trunk line in the rest pose, built like a source's by `frames`."""
    model = figure_model()
    top = model.body("abdomen").pos + model.body("chest").pos
    top = top + (model.body("left_clavicle").pos + model.body("left_upper_arm").pos if has_arms else 0.0)
    return frames(np.array([[0.0, 1.0, 0.0]]), unit(np.array([[top[0], 0.0, top[2]]])))[0]


def _set_lines(segments: Array, trunk: Array, shoulders: Array, clavicled: bool) -> None:
    """Align the figure's trunk and shoulder lines with the source's, whose spine has joints in other places.

    Abdomen, chest and clavicles turn together by some degrees, more where the spine bends; then the clavicles turn, if
    the source has them. The head looks where the source's does. Changes `segments`.
    """
    model = figure_model()
    abdomen, chest = model.body("abdomen").pos, model.body("chest").pos
    sides = [BODIES.index(f"{side}_clavicle") for side in SIDES]
    carried = [BODIES.index(body) for body in ("abdomen", "chest")] + sides
    for _ in range(_ROUNDS):
        ends = [
            quaternions.rotated(segments[:, 2], model.body(BODIES[clavicle]).pos)
            + quaternions.rotated(segments[:, clavicle], model.body(f"{side}_upper_arm").pos)
            for side, clavicle in zip(SIDES, sides, strict=True)
        ]
        own = quaternions.rotated(segments[:, 0], abdomen) + quaternions.rotated(segments[:, 1], chest)
        own = unit(own + (ends[0] + ends[1]) / 2.0)
        turn = quaternions.arcs(own, np.where(np.isnan(trunk), own, trunk))
        segments[:, carried] = quaternions.product(turn[:, None], segments[:, carried])
        if not clavicled:
            continue
        own = quaternions.rotated(turn, unit(ends[0] - ends[1]))
        turn = quaternions.arcs(own, np.where(np.isnan(shoulders), own, shoulders))
        segments[:, sides] = quaternions.product(turn[:, None], segments[:, sides])


def _limb(
    source: Array | None, bone: Array, hinge: Array, parent: Array, along: tuple[int, float], across: int,
    counted: Array,
) -> Array:  # fmt: skip
    """R of a limb's segment: axis `along` is on its bone in every frame, axis `across` on its hinge on average.

    The average is weighted by `counted` (n,).
    """
    axis, sign = along
    if np.isnan(bone).any():
        return parent if source is None else carried(source, parent, counted)
    bone = unit(bone)
    straight = quaternions.product(quaternions.arcs(sign * quaternions.rotated(parent, np.eye(3)[axis]), bone), parent)
    unbent = quaternions.rotated(straight, np.eye(3)[across])
    sine = np.linalg.norm(hinge, axis=1, keepdims=True)
    evidence = counted[:, None] * (np.nan_to_num(hinge * np.maximum(sine - _BEND, 0.0)) + _UNBENT * unbent)
    if source is None:
        return straight
    back = quaternions.conjugate(source)
    long = unit(counted @ quaternions.rotated(back, bone))
    lateral = quaternions.rotated(back, evidence).sum(axis=0)
    lateral = unit(lateral - long * (lateral @ long))
    columns = np.empty((3, 3))
    columns[:, axis], columns[:, across] = sign * long, lateral
    third = 3 - axis - across
    columns[:, third] = np.cross(columns[:, (third + 1) % 3], columns[:, (third + 2) % 3])
    turned = quaternions.product(source, np.asarray(Rotation.from_matrix(columns).as_quat(scalar_first=True)))
    # In files that stretch bones, or bend them at joints in between, bones turn relative to the joint frames.
    return quaternions.product(quaternions.arcs(sign * quaternions.rotated(turned, np.eye(3)[axis]), bone), turned)
