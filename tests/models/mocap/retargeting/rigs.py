"""Rigs by machine: a known motion of the figure, re-expressed on somebody's skeleton and written as BVH."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import BODIES, SEGMENTS, figure_model
from models.mocap.motion import quaternions

# What vendors call the parts: pelvis, abdomen, chest, neck, head; clavicle, upper arm, forearm, hand; thigh, shank,
# foot, toe. @ is the side, as the family writes it.
FAMILIES = {
    "MotionBuilder": ("Left Right", "Hips Spine Spine1 Neck Head",
                "@Shoulder @Arm @ForeArm @Hand @UpLeg @Leg @Foot @ToeBase"),
    "Mixamo": ("Left Right", "mixamorig:Hips mixamorig:Spine mixamorig:Spine2 mixamorig:Neck mixamorig:Head",
               "mixamorig:@Shoulder mixamorig:@Arm mixamorig:@ForeArm mixamorig:@Hand mixamorig:@UpLeg mixamorig:@Leg "
               "mixamorig:@Foot mixamorig:@ToeBase"),
    "Rokoko": ("Left Right", "Hips Spine1 Spine4 Neck Head", "@Shoulder @Arm @ForeArm @Hand @Thigh @Shin @Foot @Toe"),
    "Xsens": ("Left Right", "Pelvis L3 T8 Neck Head",
              "@Shoulder @UpperArm @ForeArm @Hand @UpperLeg @LowerLeg @Foot @Toe"),
    "Vicon": ("l r", "root lowerback thorax lowerneck head",
              "@clavicle @humerus @radius @hand @femur @tibia @foot @toes"),
    "OptiTrack": ("L R", "Skeleton1_Hip Skeleton1_Ab Skeleton1_Chest Skeleton1_Neck Skeleton1_Head",
                  "Skeleton1_@Shoulder Skeleton1_@UArm Skeleton1_@FArm Skeleton1_@Hand Skeleton1_@Thigh "
                  "Skeleton1_@Shin Skeleton1_@Foot Skeleton1_@Toe"),
    "Biovision": ("Left Right", "Hips Chest Chest2 Neck Head",
                  "@Collar @Shoulder @Elbow @Wrist @Hip @Knee @Ankle @Toe"),
    "Bandai": ("L R", "Hips Spine Chest Neck Head",
               "Shoulder_@ UpperArm_@ LowerArm_@ Hand_@ UpperLeg_@ LowerLeg_@ Foot_@ Toes_@"),
    "Biped": ("L R", "Bip01_Pelvis Bip01_Spine Bip01_Spine1 Bip01_Neck Bip01_Head",
              "Bip01_@_Clavicle Bip01_@_UpperArm Bip01_@_Forearm Bip01_@_Hand Bip01_@_Thigh Bip01_@_Calf Bip01_@_Foot "
              "Bip01_@_Toe0"),
    "SMPL": ("L R", "Pelvis Spine1 Spine3 Neck Head",
             "@_Collar @_Shoulder @_Elbow @_Wrist @_Hip @_Knee @_Ankle @_Foot"),
    "Unreal": ("l r", "pelvis spine_01 spine_03 neck_01 head",
               "clavicle_@ upperarm_@ lowerarm_@ hand_@ thigh_@ calf_@ foot_@ ball_@"),
    "Rigify": ("L R", "DEF-hips DEF-spine DEF-chest DEF-neck DEF-head",
               "DEF-shoulder.@ DEF-upper_arm.@ DEF-forearm.@ DEF-hand.@ DEF-thigh.@ DEF-shin.@ DEF-foot.@ DEF-toe.@"),
    "Skeleton_001": ("Left Right", "Skeleton_001_Hips Skeleton_001_Spine Skeleton_001_Chest Skeleton_001_Neck "
                     "Skeleton_001_Head",
                     "Skeleton_001_@Shoulder Skeleton_001_@Arm Skeleton_001_@ForeArm Skeleton_001_@Hand "
                     "Skeleton_001_@UpLeg Skeleton_001_@Leg Skeleton_001_@Foot Skeleton_001_@ToeBase"),
    "Bob": ("L R", "Bob_Pelvis Bob_Spine Bob_Chest Bob_Neck Bob_Head",
            "Bob_@Clavicle Bob_@UpperArm Bob_@Forearm Bob_@Hand Bob_@Thigh Bob_@Calf Bob_@Foot Bob_@Toe"),
    "Reallusion": ("L R", "RL_Hip RL_Waist RL_Spine02 RL_Neck RL_Head",
                   "RL_@_Clavicle RL_@_Upperarm RL_@_Forearm RL_@_Hand RL_@_Thigh RL_@_Calf RL_@_Foot RL_@_ToeBase"),
    "SMPL in FBX": ("L R", "m_avg_Pelvis m_avg_Spine1 m_avg_Spine3 m_avg_Neck m_avg_Head",
                    "m_avg_@_Collar m_avg_@_Shoulder m_avg_@_Elbow m_avg_@_Wrist m_avg_@_Hip m_avg_@_Knee "
                    "m_avg_@_Ankle m_avg_@_Foot"),
    "BN": ("L R", "BN_Pelvis BN_Spine BN_Chest BN_Neck BN_Head",
           "BN_Clavicle_@ BN_UpperArm_@ BN_Forearm_@ BN_Hand_@ BN_Thigh_@ BN_Calf_@ BN_Foot_@ BN_Toe_@"),
    "bind": ("left right", "bind_hips bind_spine bind_chest bind_neck bind_head",
             "bind_@_clavicle bind_@_arm bind_@_forearm bind_@_hand bind_@_thigh bind_@_shin bind_@_foot bind_@_toe"),
    "b_l": ("l r", "b_root b_spine0 b_spine3 b_neck0 b_head",
            "b_@_shoulder b_@_arm b_@_forearm b_@_wrist b_@_upleg b_@_leg b_@_foot b_@_ball"),
    "Havok": ("L R", "HavokBipedRig_Pelvis HavokBipedRig_Spine HavokBipedRig_Spine1 HavokBipedRig_Neck "
              "HavokBipedRig_Head",
              "HavokBipedRig_@_Clavicle HavokBipedRig_@_UpperArm HavokBipedRig_@_ForeArm HavokBipedRig_@_Hand "
              "HavokBipedRig_@_Thigh HavokBipedRig_@_Calf HavokBipedRig_@_Foot HavokBipedRig_@_Toe0"),
    "Auto-Rig Pro": ("l r", "root.x spine_01.x spine_02.x neck.x head.x",
                     "shoulder.@ arm_stretch.@ forearm_stretch.@ hand.@ thigh_stretch.@ leg_stretch.@ foot.@ "
                     "toes_01.@"),
    "Maya": ("l r", "root_JNT spine_01_JNT spine_02_JNT neck_JNT head_JNT",
             "@_clavicle_JNT @_arm_JNT @_elbow_JNT @_wrist_JNT @_upleg_JNT @_lowleg_JNT @_ankle_JNT @_ball_JNT"),
    "Maya, HumanIK": ("Left Right", "Hips_jnt Spine_jnt Spine1_jnt Neck_jnt Head_jnt",
                      "@Shoulder_jnt @Arm_jnt @ForeArm_jnt @Hand_jnt @UpLeg_jnt @Leg_jnt @Foot_jnt @ToeBase_jnt"),
    "lower case": ("left right", "hips spine spine1 neck head",
                   "@shoulder @arm @forearm @hand @upleg @leg @foot @toebase"),
    "Second Life": ("Left Right", "mPelvis mTorso mChest mNeck mHead",
                    "mCollar@ mShoulder@ mElbow@ mWrist@ mHip@ mKnee@ mAnkle@ mFoot@"),
    "Lt": ("Lt Rt", "Pelvis Spine Chest Neck Head",
           "@_Clavicle @_UpperArm @_Forearm @_Hand @_Thigh @_Calf @_Foot @_Toe"),
    "lf": ("lf rf", "pelvis spine chest neck head", "@_shoulder @_arm @_elbow @_wrist @_thigh @_shin @_ankle @_toe"),
    "MMD": ("左 右", "下半身 上半身 上半身2 首 頭", "@肩 @腕 @ひじ @手首 @足 @ひざ @足首 @つま先"),
    "MMD in English": ("L R", "lower_body upper_body upper_body2 neck head",
                       "shoulder_@ arm_@ elbow_@ wrist_@ leg_@ knee_@ ankle_@ toe_@"),
    "hip joints": ("l r", "root lowerback thorax lowerneck head",
                   "@ClavicleJoint @ShoulderJoint @ElbowJoint @WristJoint @HipJoint @KneeJoint @AnkleJoint @ToeJoint"),
    "LoLeg": ("L R", "Hips Spine Chest Neck Head",
              "Collar.@ UpArm.@ LoArm.@ Hand.@ UpLeg.@ LoLeg.@ Foot.@ Toe.@"),
    "Rigify metarig": ("L R", "spine spine.001 spine.003 spine.004 spine.006",
                       "shoulder.@ upper_arm.@ forearm.@ hand.@ thigh.@ shin.@ foot.@ toe.@"),
    "VRM": ("L R", "J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_UpperChest J_Bip_C_Neck J_Bip_C_Head",
            "J_Bip_@_Shoulder J_Bip_@_UpperArm J_Bip_@_LowerArm J_Bip_@_Hand J_Bip_@_UpperLeg J_Bip_@_LowerLeg "
            "J_Bip_@_Foot J_Bip_@_ToeBase"),
    "Mixamo in glTF": ("Left Right", "mixamorig:Hips_01 mixamorig:Spine_02 mixamorig:Spine2_04 mixamorig:Neck_05 "
                       "mixamorig:Head_06",
                       "mixamorig:@Shoulder_08 mixamorig:@Arm_09 mixamorig:@ForeArm_010 mixamorig:@Hand_011 "
                       "mixamorig:@UpLeg_055 mixamorig:@Leg_056 mixamorig:@Foot_057 mixamorig:@ToeBase_058"),
    "AdvancedSkeleton": ("L R", "Root_M Spine1_M Chest_M Neck_M Head_M",
                         "Scapula_@ Shoulder_@ Elbow_@ Wrist_@ Hip_@ Knee_@ Ankle_@ Toes_@"),
    "Valve": ("L R", "ValveBiped.Bip01_Pelvis ValveBiped.Bip01_Spine ValveBiped.Bip01_Spine2 ValveBiped.Bip01_Neck1 "
              "ValveBiped.Bip01_Head1",
              "ValveBiped.Bip01_@_Clavicle ValveBiped.Bip01_@_UpperArm ValveBiped.Bip01_@_Forearm "
              "ValveBiped.Bip01_@_Hand ValveBiped.Bip01_@_Thigh ValveBiped.Bip01_@_Calf ValveBiped.Bip01_@_Foot "
              "ValveBiped.Bip01_@_Toe0"),
    "OpenSim": ("l r", "pelvis lumbar torso neck head",
                "scapula_@ humerus_@ ulna_@ hand_@ femur_@ tibia_@ talus_@ toes_@"),
    "anatomy": ("Left Right", "Pelvis Lumbar Thorax Neck Head",
                "@Scapula @Humerus @Ulna @Carpus @Femur @Tibia @Talus @Toes"),
    "Daz": ("l r", "hip abdomenUpper chestUpper neckLower head",
            "@Collar @ShldrBend @ForearmBend @Hand @ThighBend @Shin @Foot @Toe"),
}  # fmt: skip
ZERO_POSES = ("T", "A", "random", "along X", "legs up", "along bones Y")
UPS = {"+Y": (0, 1, 0), "+Z": (0, 0, 1), "-Y": (0, -1, 0), "-Z": (0, 0, -1), "+X": (1, 0, 0), "-X": (-1, 0, 0)}
PARTS = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot", "toe")


@dataclass(frozen=True)
class Rig:
    """How a skeleton is drawn and written."""

    family: str = "MotionBuilder"
    zero: str = "T"
    up: str = "+Y"
    turn: float = 0.0  # of the whole file about its vertical [rad]
    unit: float = 0.01  # [m]
    order: str = "ZXY"
    twists: bool = False
    fingers: bool = False
    reference: bool = False
    namespace: str = ""
    without: tuple[str, ...] = ()  # head, clavicle, hand, toe
    proportions: dict[str, float] = field(default_factory=dict)
    leading: int = 0  # frames of the zero pose in front of the motion
    seed: int = 0


def random_rig(rng: np.random.Generator) -> Rig:
    """Any combination."""

    def some(share):
        return bool(rng.random() < share)

    without = tuple(part for part in ("head", "clavicle", "toe") if some(0.15))
    scaled = ("forearm", "upper_arm", "thigh", "shank", "trunk", "hips", "foot") if some(0.4) else ()
    return Rig(
        family=str(rng.choice(list(FAMILIES))),
        zero=str(rng.choice(ZERO_POSES)),
        up=str(rng.choice(list(UPS), p=[0.4, 0.4, 0.05, 0.05, 0.05, 0.05])),
        turn=float(rng.choice([0.0, np.pi / 2, np.pi, -np.pi / 2, rng.uniform(-np.pi, np.pi)])),
        unit=float(rng.choice([1.0, 0.01, 0.0254, 0.001])),
        order="".join(rng.permutation(list("XYZ"))),
        twists=some(0.3), fingers=some(0.3), reference=some(0.2),
        namespace=str(rng.choice(["", "", "Actor_1:", "char|"])),
        without=without,
        proportions={part: float(rng.uniform(0.85, 1.15)) for part in scaled},
        leading=int(some(0.1)),
        seed=int(rng.integers(1 << 30)),
    )  # fmt: skip


def _joints(rig):
    """Name, carrying body, parent's name and place in its frame, of every joint."""
    sides, centre, limbs = FAMILIES[rig.family]
    centre, limbs, sides = centre.split(), limbs.split(), sides.split()
    model = figure_model()
    scale = {"upper_arm": "clavicle", "forearm": "upper_arm", "hand": "forearm", "shank": "thigh", "foot": "shank"}

    def place(body):
        size = {"abdomen": "trunk", "chest": "trunk", "head": "trunk", "clavicle": "trunk", "thigh": "hips"}
        bare = body.removeprefix("left_").removeprefix("right_")
        key = size.get(bare, scale.get(bare, ""))
        return np.array(model.body(body).pos) * rig.proportions.get(key, 1.0)

    name = lambda text: rig.namespace + text  # noqa: E731
    rows = []
    if rig.reference:
        rows.append((name("Reference"), None, None, np.zeros(3)))
    rows.append((name(centre[0]), "pelvis", rows[0][0] if rows else None, np.zeros(3)))
    rows.append((name(centre[1]), "abdomen", name(centre[0]), place("abdomen")))
    rows.append((name(centre[2]), "chest", name(centre[1]), place("chest")))
    if "head" not in rig.without:
        rows.append((name(centre[3]), "chest", name(centre[2]), 0.75 * place("head")))
        rows.append((name(centre[4]), "head", name(centre[3]), 0.25 * place("head")))
    for side, mark in zip(("left", "right"), sides, strict=True):
        title = [name(limb.replace("@", mark)) for limb in limbs]
        shoulder = place(f"{side}_upper_arm")
        if "clavicle" in rig.without:
            rows.append((title[1], f"{side}_upper_arm", name(centre[2]), place(f"{side}_clavicle") + shoulder))
        else:
            rows.append((title[0], f"{side}_clavicle", name(centre[2]), place(f"{side}_clavicle")))
            rows.append((title[1], f"{side}_upper_arm", title[0], shoulder))
        previous = title[1]
        for part, joint in zip(("forearm", "hand"), title[2:4], strict=True):
            at, carrier = place(f"{side}_{part}"), f"{side}_upper_arm" if part == "forearm" else f"{side}_forearm"
            if rig.twists:
                rows.append((previous + "Twist", f"twist {carrier}", previous, at / 2))
                rows.append((joint, f"{side}_{part}", previous + "Twist", at / 2))
            else:
                rows.append((joint, f"{side}_{part}", previous, at))
            previous = joint
        if rig.fingers:
            out = 0.08 if side == "left" else -0.08
            for k, finger in enumerate(("Thumb", "Index", "Pinky")):
                rows.append((f"{title[3]}{finger}1", f"{side}_hand", title[3], np.array([0.03 - 0.03 * k, out, 0.0])))
                rows.append((f"{title[3]}{finger}2", f"{side}_hand", f"{title[3]}{finger}1", np.array([0, out / 3, 0])))
        rows.append((title[4], f"{side}_thigh", name(centre[0]), place(f"{side}_thigh")))
        rows.append((title[5], f"{side}_shank", title[4], place(f"{side}_shank")))
        rows.append((title[6], f"{side}_foot", title[5], place(f"{side}_foot")))
        if "toe" not in rig.without:
            size = rig.proportions.get("foot", 1.0)
            rows.append((title[7], f"{side}_foot", title[6], size * np.array([0.12, 0.0, -0.05])))
    return rows


def _zero_turns(rig, rows, rng):
    """D of every joint: R D is how its frame stands, R being its segment's rotation from the figure's rest."""
    children = {}
    for _name, _, parent, at in rows:
        if parent is not None and np.linalg.norm(at) > 1e-6:
            children.setdefault(parent, at)
    turns = {}
    for name, body, _, _ in rows:
        bone = children.get(name, np.array([0.0, 0.0, 0.1]))
        if rig.zero == "random":
            turns[name] = Rotation.random(random_state=int(rng.integers(1 << 30)))
        elif rig.zero in ("along X", "along bones Y"):
            axis = np.eye(3)[0 if rig.zero == "along X" else 1]
            turns[name] = Rotation.align_vectors([bone / np.linalg.norm(bone)], [axis])[0]
        elif rig.zero == "legs up" and body and body.split("_")[-1] in ("thigh", "shank", "foot"):
            turns[name] = Rotation.from_euler("y", np.pi)
        elif rig.zero == "A" and body and any(part in body for part in ("upper_arm", "forearm", "hand")):
            turns[name] = Rotation.from_euler("x", np.pi / 4 if "left" in body else -np.pi / 4)
        else:
            turns[name] = Rotation.identity()
    return turns


def write_rig(rig: Rig, clip, path: Path) -> None:
    """Write the clip's motion as a BVH of this rig."""
    rng = np.random.default_rng(rig.seed)
    rows = _joints(rig)
    turns = _zero_turns(rig, rows, rng)
    up = np.array(UPS[rig.up], dtype=float)
    first = np.roll(up, 1)
    to_file = Rotation.from_matrix(np.column_stack((first, np.cross(up, first), up)))
    to_file = to_file * Rotation.from_euler("z", rig.turn)
    local = clip.poses[:, 3:].reshape(clip.n_frames, -1, 4)
    world = local.copy()
    for index, segment in enumerate(SEGMENTS):
        if segment.parent >= 0:
            world[:, index] = quaternions.product(world[:, segment.parent], local[:, index])
    height = clip.poses[:, :3] * 1.0
    rotations = {}
    for name, body, _, at in rows:
        if body is None:
            rotations[name] = Rotation.identity(clip.n_frames)
            continue
        bare = body.removeprefix("twist ")
        turned = to_file * Rotation.from_quat(world[:, BODIES.index(bare)], scalar_first=True)
        if rig.twists and body.endswith(("upper_arm", "forearm")) and not body.startswith("twist"):
            # The joint itself does not twist with its bone: what the twist joint does is its own affair.
            angle = 0.6 * np.sin(np.arange(clip.n_frames) / 17.0)
            turned = turned * Rotation.from_rotvec(np.outer(angle, [0.0, 1.0, 0.0]))
            at = np.array(at)
        rotations[name] = turned * turns[name]
    lines, order = ["HIERARCHY"], [name for name, *_ in rows]
    frames_of = {}

    def emit(index, depth):
        name, _, parent, at = rows[index]
        offset = np.zeros(3)
        if parent is not None:
            offset = turns[parent].inv().apply(at) / rig.unit if parent in turns else at / rig.unit
        tab = "\t" * depth
        lines.append(f"{tab}{'ROOT' if depth == 0 else 'JOINT'} {name}")
        lines.append(tab + "{")
        lines.append(f"{tab}\tOFFSET {offset[0]:.9f} {offset[1]:.9f} {offset[2]:.9f}")
        moving = name == mover
        channels = " ".join(f"{axis}rotation" for axis in rig.order)
        lines.append(f"{tab}\tCHANNELS {'6 Xposition Yposition Zposition' if moving else '3'} {channels}")
        relative = rotations[name] if parent is None else rotations[parent].inv() * rotations[name]
        angles = relative.as_euler(rig.order, degrees=True)
        frames_of[name] = np.hstack([to_file.apply(height) / rig.unit, angles]) if moving else angles
        columns.append(name)
        kids = [k for k in range(len(rows)) if rows[k][2] == name]
        for kid in kids:
            emit(kid, depth + 1)
        if not kids:
            lines.extend([f"{tab}\tEnd Site", tab + "\t{", f"{tab}\t\tOFFSET 0 0 0", tab + "\t}"])
        lines.append(tab + "}")

    mover = next(name for name, body, *_ in rows if body == "pelvis")
    columns = []
    emit(0, 0)
    assert len(columns) == len(order)
    table = np.hstack([frames_of[name] for name in columns])
    if rig.leading:
        zero = np.zeros((rig.leading, table.shape[1]))
        table = np.vstack([zero, table])
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {1.0 / clip.fps:.9f}"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in table]
    path.write_text("\n".join(lines) + "\n")
