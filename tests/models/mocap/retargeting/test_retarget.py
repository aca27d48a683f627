import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import quaternions
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, figure_model
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.readers.formats import read_motion
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.retargeting.retarget import retarget
from models.mocap.retargeting.skeleton_roles import joints_below, roles_of
from tests.models.mocap.readers.motion_files import AMC, ASF
from tests.models.mocap.retargeting.rigs import Rig, write_rig

# Walk, run, jump, dance and kick, from skeletons that differ in rest pose, names, axes and units.
MOTIONS = (
    "cmu_amc/02_01.amc", "cmu_amc/02_03.amc", "cmu_amc/02_04.amc", "cmu_bvh/131_03.bvh", "snu/walk.bvh", "snu/run.bvh",
    "snu/dance.bvh", "snu/kick.bvh", "snu/cart.bvh", "deepmimic/humanoid3d_walk.txt", "deepmimic/humanoid3d_run.txt",
    "deepmimic/humanoid3d_jump.txt", "deepmimic/humanoid3d_dance_b.txt", "deepmimic/humanoid3d_kick.txt",
    "deepmimic/humanoid3d_backflip.txt", "animated_drawings/jumping.bvh", "xia/angry_13_000.bvh",
    "quirks/bvh_test2.bvh", "quirks/bvh_test3.bvh", "quirks/Geno_stance.bvh",
)  # fmt: skip
LIMBS = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shank", "shank": "foot"}


@pytest.fixture(scope="module")
def model():
    return figure_model()


def mujoco_kinematics(model, clip, frames):
    """Body positions, and heights of the contact points of the soles, by MuJoCo."""
    data = mujoco.MjData(model)
    contacts = [model.geom(name).id for name in FOOT_CONTACTS]
    bodies, soles = [], []
    for k in frames:
        data.qpos[:] = clip.poses[k]
        mujoco.mj_kinematics(model, data)
        bodies.append(data.xpos[1:].copy())
        soles.append(data.geom_xpos[contacts, 2] - CONTACT_RADIUS)
    return np.array(bodies), np.array(soles)


@pytest.mark.parametrize("name", MOTIONS)
def test_limbs_point_in_the_directions_of_the_source(mocap, model, name):
    """Compared after one rotation of the source's axes that fits all limbs in all frames."""
    motion = read_motion(mocap / name)
    roles = roles_of(motion.joints, motion.parents)
    clip = load(mocap / name).clip
    frames = range(0, motion.n_frames, max(1, motion.n_frames // 60))
    bodies, _ = mujoco_kinematics(model, clip, frames)
    places = motion.global_positions(motion.global_rotations())[frames]
    figure_limbs, source_limbs = [], []
    for side in ("left", "right"):
        for body, child in LIMBS.items():
            limb = f"{side}_{body}"
            figure_limbs.append(bodies[:, BODIES.index(f"{side}_{child}")] - bodies[:, BODIES.index(limb)])
            source_limbs.append(places[:, roles.ends[limb]] - places[:, roles.segments[limb]])
    figure_limbs, source_limbs = (
        np.stack(x, axis=1) / np.linalg.norm(x, axis=2).T[..., None] for x in (figure_limbs, source_limbs)
    )
    # One rotation takes the file's axes to the world's for the whole clip.
    axis_turn, _ = Rotation.align_vectors(figure_limbs.reshape(-1, 3), source_limbs.reshape(-1, 3))
    turned = axis_turn.apply(source_limbs.reshape(-1, 3)).reshape(source_limbs.shape)
    angles = np.rad2deg(2 * np.arcsin(np.clip(np.linalg.norm(figure_limbs - turned, axis=2) / 2, 0, 1)))
    assert np.median(angles, axis=0).max() < 1.0
    assert angles.max() < 3.0


@pytest.mark.parametrize("name", MOTIONS)
def test_figure_stands_on_the_floor_at_the_origin_facing_forwards(mocap, model, name):
    clip = load(mocap / name).clip
    _, soles = mujoco_kinematics(model, clip, range(clip.n_frames))
    lowest = soles.min(axis=1)
    # Frames with a foot on the floor are many, and few go deeper than a shoe's sole.
    assert np.quantile(lowest, 0.05) > -0.05
    assert np.median(lowest) > -0.02
    assert np.mean(np.abs(lowest) < 0.03) > 0.2
    np.testing.assert_allclose(clip.poses[0, :2], 0.0, atol=1e-12)
    forward = quaternions.rotated(clip.poses[0, 3:7], np.array([1.0, 0.0, 0.0]))
    assert forward[0] > 0.5
    assert abs(forward[1]) < 1e-9


@pytest.mark.parametrize("name", [name for name in MOTIONS if "bvh_test" not in name and "Geno" not in name])
def test_knees_and_elbows_bend_in_human_directions(mocap, name):
    clip = load(mocap / name).clip
    joints = {joint: quaternions.logarithm(clip.poses[:, 3 + 4 * k : 7 + 4 * k]) for k, joint in enumerate(BODIES)}
    for side, sign in (("left", -1.0), ("right", 1.0)):
        knee, elbow = joints[f"{side}_shank"], joints[f"{side}_forearm"]
        assert np.quantile(knee[:, 1], 0.05) > -np.deg2rad(10), side
        assert np.abs(np.median(knee[:, [0, 2]], axis=0)).max() < np.deg2rad(20), side
        bent = np.linalg.norm(elbow, axis=1) > np.deg2rad(30)
        assert (sign * elbow[bent, 2] > -np.deg2rad(10)).all() or "snu/kick" in name, side


@pytest.mark.slow
def test_amc_and_bvh_of_one_motion_give_the_same_clip(mocap):
    """The first frame of the BVH is a rest pose, which is dropped."""
    amc, (bvh, report, _) = load(mocap / "cmu_amc/01_01.amc").clip, load(mocap / "cmu_amc/01_01.bvh")
    assert report.dropped == 1
    assert "left out: the first frame" in "\n".join(report.lines())
    assert bvh.n_frames == amc.n_frames
    gap = pose_difference(amc.poses, bvh.poses)
    hinges = [k for k, body in enumerate(BODIES) if body.endswith(("shank", "forearm", "hand", "foot"))]
    assert max(np.abs(gap[:, 3 + 3 * k : 6 + 3 * k]).max() for k in hinges) < 2e-3
    # The BVH leaves out the neck and hangs the arms elsewhere: their lines of the trunk differ.
    assert np.abs(gap[:, 3:]).max() < np.deg2rad(5)
    np.testing.assert_allclose(bvh.poses[:, :3], amc.poses[:, :3], atol=1e-2)


def test_centre_of_mass_of_a_flight_keeps_its_parabola(mocap, model):
    """CMU's jump: the figure's centre of mass falls with g times its size over the performer's."""
    clip, report, _ = load(mocap / "cmu_amc/02_04.amc")
    _, soles = mujoco_kinematics(model, clip, range(clip.n_frames))
    flying = np.flatnonzero(soles.min(axis=1) > 0.1)
    data, heights = mujoco.MjData(model), []
    for pose in clip.poses[flying]:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        heights.append(data.subtree_com[0, 2])
    fall = -2 * np.polyfit(flying / clip.fps, heights, 2)[0]
    assert len(flying) > 40
    assert fall == pytest.approx(9.81 * report.scale / (0.0254 / 0.45), rel=0.05)


@pytest.mark.parametrize(
    ("name", "up", "facing", "unit"),
    [
        ("cmu_amc/02_01.amc", "+Y", "+Z", "0.056444 m"),
        ("cmu_bvh/scaled_131_03.bvh", "+Y", "+Z", "metres"),
        ("snu/walk.bvh", "+Y", "+Z", "centimetres"),
        ("deepmimic/humanoid3d_walk.txt", "+Y", "+X", "1 m"),
        ("animated_drawings/wave_hello.bvh", "+Z", "+Y", "unknown"),
        ("quirks/bvh_test3.bvh", "+Z", "+Y", "inches"),
    ],
)
def test_axes_and_unit_are_inferred_and_reported(mocap, name, up, facing, unit):
    _, report, _ = load(mocap / name)
    assert (report.up, report.facing) == (up, facing)
    assert report.unit.startswith(unit)
    report_text = "\n".join(report.lines())
    assert up in report_text
    assert unit in report_text


def test_clip_in_two_units_gives_the_same_motion(mocap):
    """Both hold the performer of 131_03; the second, in metres, goes on for 146 frames."""
    small, large = (read_motion(mocap / f"cmu_bvh/{name}131_03.bvh") for name in ("", "scaled_"))
    n = small.n_frames
    large = replace(large, rotations=large.rotations[:n], translations=large.translations[:n])
    first, second = (retarget(motion, roles_of(motion.joints, motion.parents))[0] for motion in (small, large))
    np.testing.assert_allclose(pose_difference(first.poses, second.poses), 0.0, atol=5e-3)


AXES = [axis_turn for axis_turn in Rotation.create_group("O") if axis_turn.magnitude() > 0.1]


@pytest.mark.parametrize(
    "axis_turn", AXES[::4], ids=[str(axis_turn.as_rotvec(degrees=True).round()) for axis_turn in AXES[::4]]
)
def test_any_axes_and_any_unit_give_the_same_clip(mocap, axis_turn):
    motion = read_motion(mocap / "snu/run.bvh")
    roles = roles_of(motion.joints, motion.parents)
    q = axis_turn.as_quat(scalar_first=True)
    other = replace(
        motion,
        offsets=100 * axis_turn.apply(motion.offsets),
        tips=100 * axis_turn.apply(motion.tips),
        translations=100 * quaternions.rotated(q, motion.translations),
        rotations=quaternions.product(quaternions.product(q, motion.rotations), quaternions.conjugate(q)),
    )
    (clip, report), (clip_of_other, report_of_other) = retarget(motion, roles), retarget(other, roles)
    np.testing.assert_allclose(pose_difference(clip.poses, clip_of_other.poses), 0.0, atol=1e-9)
    assert report_of_other.scale == pytest.approx(report.scale / 100)
    sign, axis = np.sign(axis_turn.apply([0, 1, 0]).sum()), int(np.argmax(np.abs(axis_turn.apply([0, 1, 0]))))
    assert report_of_other.up == f"{'+' if sign > 0 else '-'}{'XYZ'[axis]}"


def test_foreign_joints_are_listed_as_unused_and_take_no_role(mocap):
    _, report, _ = load(mocap / "snu/kick.bvh")
    assert {"R_Foot", "R_Tibia", "L_Humerus", "Torso"} <= set(report.unused)
    assert report.taken["right_shank"] == "Character1_RightLeg"
    assert report.missing == ()


def test_report_names_twelve_unused_joints_and_counts_all(mocap):
    _, report, _ = load(mocap / "snu/kick.bvh")
    (line,) = (
        line for line in report._replace(unused=tuple(f"face{k}" for k in range(145))).lines() if "unused" in line
    )
    assert line.startswith("unused: face0, face1, ")
    assert line.endswith(", face11, … (145 joints)")
    (line,) = (line for line in report._replace(unused=()).lines() if "unused" in line)
    assert line == "unused: none"


def test_missing_joints_are_listed_and_follow_their_neighbours(mocap):
    clip, report, _ = load(mocap / "deepmimic/humanoid3d_walk.txt")
    assert [line.split()[0] for line in report.missing] == ["abdomen", "left_clavicle", "right_clavicle"]
    clavicle = 3 + 4 * BODIES.index("left_clavicle")
    np.testing.assert_allclose(clip.poses[:, clavicle : clavicle + 4], [[1.0, 0, 0, 0]] * clip.n_frames, atol=1e-12)
    # The one joint of the spine is shared between the figure's two.
    abdomen, chest = (clip.poses[:, 3 + 4 * k : 7 + 4 * k] for k in (1, 2))
    np.testing.assert_allclose(quaternions.logarithm(abdomen), quaternions.logarithm(chest), atol=5e-3)


SKELETONS = {
    "3ds Max Biped": (
        "Bip01", "Bip01 Pelvis", "Bip01 Spine", "Bip01 Spine1", "Bip01 Neck", "Bip01 Head",
        "Bip01 L Clavicle", "Bip01 L UpperArm", "Bip01 L Forearm", "Bip01 L Hand",
        "Bip01 R Clavicle", "Bip01 R UpperArm", "Bip01 R Forearm", "Bip01 R Hand",
        "Bip01 L Thigh", "Bip01 L Calf", "Bip01 L Foot", "Bip01 L Toe0",
        "Bip01 R Thigh", "Bip01 R Calf", "Bip01 R Foot", "Bip01 R Toe0",
    ),
    "Mixamo": (
        "Armature", "mixamorig:Hips", "mixamorig:Spine", "mixamorig:Spine2", "mixamorig:Neck", "mixamorig:Head",
        "mixamorig:LeftShoulder", "mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand",
        "mixamorig:RightShoulder", "mixamorig:RightArm", "mixamorig:RightForeArm", "mixamorig:RightHand",
        "mixamorig:LeftUpLeg", "mixamorig:LeftLeg", "mixamorig:LeftFoot", "mixamorig:LeftToeBase",
        "mixamorig:RightUpLeg", "mixamorig:RightLeg", "mixamorig:RightFoot", "mixamorig:RightToeBase",
    ),
    "Biovision": (
        "Reference", "Hips", "Chest", "Chest2", "Neck", "Head", "LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist",
        "RightCollar", "RightShoulder", "RightElbow", "RightWrist", "LeftHip", "LeftKnee", "LeftAnkle", "LeftToe",
        "RightHip", "RightKnee", "RightAnkle", "RightToe",
    ),
    "Unreal": (
        "root", "pelvis", "spine_01", "spine_02", "neck_01", "head",
        "clavicle_l", "upperarm_l", "lowerarm_l", "hand_l", "clavicle_r", "upperarm_r", "lowerarm_r", "hand_r",
        "thigh_l", "calf_l", "foot_l", "ball_l", "thigh_r", "calf_r", "foot_r", "ball_r",
    ),
    "SFU": (
        "Reference", "Hips", "Spine", "Spine1", "Neck", "Head", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand",
        "RightShoulder", "RightArm", "RightForeArm", "RightHand", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase",
        "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase",
    ),
}  # fmt: skip
PARENTS = (-1, 0, 1, 2, 3, 4, 3, 6, 7, 8, 3, 10, 11, 12, 1, 14, 15, 16, 1, 18, 19, 20)


@pytest.mark.parametrize("family", SKELETONS)
def test_joint_names_of_skeleton_families_get_their_roles(family):
    roles = roles_of(SKELETONS[family], PARENTS)
    assert not isinstance(roles, str), roles
    expected = (1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 19, 20)
    assert tuple(roles.segments[body] for body in BODIES) == expected
    assert roles.ends["left_foot"] == 17
    assert roles.ends["right_forearm"] == 13


def test_rest_pose_with_hanging_arms_keeps_them_hanging(mocap, model):
    """Zero rotations of DeepMimic's humanoid: arms and legs straight down, soles level."""
    motion = read_motion(mocap / "deepmimic/humanoid3d_walk.txt")
    still = np.zeros_like(motion.rotations[:1])
    still[..., 0] = 1.0
    rest = replace(motion, rotations=still, translations=motion.translations[:1])
    clip, _ = retarget(rest, roles_of(motion.joints, motion.parents))
    bodies, soles = mujoco_kinematics(model, clip, [0])
    for side in ("left", "right"):
        arm = bodies[0, BODIES.index(f"{side}_hand")] - bodies[0, BODIES.index(f"{side}_upper_arm")]
        np.testing.assert_allclose(arm / np.linalg.norm(arm), [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(soles, 0.0, atol=1e-9)


def test_skeleton_without_legs_is_refused(mocap):
    with pytest.raises(
        MotionFileError, match=r"sinusoidal.bvh:1: no joint was found for the left_thigh \(among base, ch"
    ):
        load(mocap / "quirks/fairmotion_sinusoidal.bvh")


def test_joints_moved_by_positions_alone_are_refused(mocap, tmp_path):
    text = (mocap / "quirks/Geno_stance.bvh").read_text().split("MOTION")
    header, rows = text[0], text[1].splitlines()
    header = re.sub(r"CHANNELS 6 (\S+ \S+ \S+) .*", r"CHANNELS 3 \1", header)
    values = np.array([row.split() for row in rows[3:] if row.strip()], dtype=float).reshape(2, -1, 6)[..., :3]
    values[1] += np.arange(3)
    lines = [" ".join(map(str, row.ravel())) for row in values]
    (tmp_path / "positions.bvh").write_text("\n".join([header + "MOTION", "Frames: 2", "Frame Time: 0.1", *lines]))
    with pytest.raises(MotionFileError, match="moved by positions alone; expected rotation channels"):
        load(tmp_path / "positions.bvh")


NON_HUMAN_LEGS = "which is not human: the file's unit is another"


@pytest.mark.parametrize(("length", "human"), [("0.45", True), ("0.01", False), ("45", False), ("1", True)])
def test_unit_of_the_format_is_doubted_if_it_gives_legs_of_no_human(tmp_path, length, human):
    (tmp_path / "1.asf").write_text(ASF.replace("length 0.45", f"length {length}"))
    (tmp_path / "1_1.amc").write_text(AMC)
    report = load(tmp_path / "1_1.amc").report
    assert report is not None
    assert "(fixed by the format), legs" in report.unit
    assert (NON_HUMAN_LEGS in report.unit) != human


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("name", ["cmu_bvh/131_03.bvh", "snu/walk.bvh", "snu/dance.bvh", "xia/angry_13_000.bvh"])
def test_body_with_one_arm_keeps_its_trunk_and_head(mocap, model, name, side):
    motion = read_motion(mocap / name)
    roles = roles_of(motion.joints, motion.parents)
    arm = joints_below(roles.segments.get(f"{side}_clavicle", roles.segments[f"{side}_upper_arm"]), motion.parents)
    names = tuple("" if k in arm else joint for k, joint in enumerate(motion.joints))
    whole, _ = retarget(motion, roles)
    clip, report = retarget(motion, roles_of(names, motion.parents))
    assert any("one arm" in remark for remark in report.remarks)
    assert {"chest", "head", "abdomen"} & roles.segments.keys() <= report.taken.keys()
    bodies = [BODIES.index(body) for body in ("pelvis", "chest", "head")]
    turned = quaternions.product(
        quaternions.conjugate(body_rotations(model, whole)[:, bodies]), body_rotations(model, clip)[:, bodies]
    )
    angles = 2.0 * np.arccos(np.clip(np.abs(turned[..., 0]), 0.0, 1.0))
    assert np.rad2deg(np.median(angles, axis=0)).max() < 14.0


def test_single_frame_that_lasts_a_second_is_read(tmp_path):
    write_rig(Rig(), Clip(embedded("walk").poses[:1], 1.0, "pose"), tmp_path / "r.bvh")
    assert load(tmp_path / "r.bvh").clip.n_frames == 1


def body_rotations(model, clip):
    """Orientations (n, 18, 4) of the figure's bodies by MuJoCo."""
    data = mujoco.MjData(model)
    rotations = []
    for pose in clip.poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        rotations.append(data.xquat[1:].copy())
    return np.array(rotations)
