"""Roles of the joints of real skeletons, from their names and their trees."""

import pytest

from models.humanoid.skeleton import BODIES
from models.mocap.retargeting.joint_names import joint_names
from models.mocap.retargeting.skeleton_roles import roles_of


def tree(text):
    """Joints and parents of a skeleton given as lines of chains; a chain starts at a joint of an earlier one."""
    joints, parents = [], []
    for line in text.strip().splitlines():
        chain = line.split()
        for k, joint in enumerate(chain):
            if joint not in joints:
                joints.append(joint)
                parents.append(joints.index(chain[k - 1]) if k else -1)
    return tuple(joints), tuple(parents)


def joints_by_role(text):
    joints, parents = tree(text)
    roles = roles_of(joints, parents)
    assert not isinstance(roles, str), roles
    return {body: joints[k] for body, k in roles.segments.items()} | {
        f"end of {body}": joints[k] for body, k in roles.ends.items()
    }


def with_both_sides(text, left, right):
    """The text with every line that contains @ repeated for the left and the right side."""
    lines = text.strip().splitlines()
    return "\n".join(line.replace("@", side) for line in lines for side in ((left, right) if "@" in line else ("",)))


# Trees of rigs as vendors ship them, shortened, and the joints of the left side and the middle, in the order of PARTS.
PARTS = ("pelvis", "abdomen", "chest", "head", "left_clavicle", "left_upper_arm", "left_forearm", "left_hand",
         "left_thigh", "left_shank", "left_foot", "end of left_foot")  # fmt: skip
VENDOR_RIGS = {
    "MMD": (
        """センター 上半身 上半身2 首 頭 左目
        上半身2 @肩P @肩 @肩C @腕 @腕捩 @ひじ @手捩 @手首 @人指１
        センター 下半身 @足 @ひざ @足首 @つま先
        センター @足ＩＫ @つま先ＩＫ""",
        "左 右", "下半身 上半身 上半身2 頭 左肩 左腕 左ひじ 左手首 左足 左ひざ 左足首 左つま先",
    ),
    "GAMES-105": (
        """RootJoint pelvis_lowerback lowerback_torso torso_head
        lowerback_torso @Torso_Clavicle @Shoulder @Elbow @Wrist
        RootJoint @Hip @Knee @Ankle @ToeJoint""",
        "l r",
        "RootJoint pelvis_lowerback lowerback_torso torso_head lTorso_Clavicle lShoulder lElbow lWrist lHip lKnee "
        "lAnkle lToeJoint",
    ),
    "joints between two bodies": (
        """pelvis pelvis_@_femur @_femur_tibia @_tibia_foot
        pelvis pelvis_spine1 spine1 spine2 neck
        spine2 @_manubrium @_clavicle @_humerus @_radius""",
        "left right",
        "pelvis spine1 spine2 neck left_clavicle left_humerus left_radius - pelvis_left_femur left_femur_tibia "
        "left_tibia_foot -",
    ),
    "links beside the joints": (
        """Pelvis Pelvis_@_Hip @_Hip @_Knee @_Ankle
        Pelvis Pelvis_Spine1 Spine1 Spine2 Spine3 Spine3_Neck Neck
        Spine3 Spine3_@_Collar @_Collar @_Shoulder @_Elbow""",
        "L R", "Pelvis Spine1 Spine3 Neck L_Collar L_Shoulder L_Elbow - L_Hip L_Knee L_Ankle -",
    ),
    "Rigify metarig": (
        """spine spine.001 spine.002 spine.003 spine.004 spine.005 spine.006
        spine pelvis.@
        spine thigh.@ shin.@ foot.@ toe.@
        foot.@ heel.02.@
        spine.003 shoulder.@ upper_arm.@ forearm.@ hand.@ palm.01.@ f_index.01.@
        spine.003 breast.@""",
        "L R",
        "spine spine.002 spine.003 spine.006 shoulder.L upper_arm.L forearm.L hand.L thigh.L shin.L foot.L toe.L",
    ),
    "Rigify's deforming bones": (
        """DEF-spine DEF-spine.001 DEF-spine.003 DEF-spine.004 DEF-spine.006
        DEF-spine DEF-thigh.@ DEF-thigh.@.001 DEF-shin.@ DEF-shin.@.001 DEF-foot.@ DEF-toe.@
        DEF-spine.003 DEF-shoulder.@ DEF-upper_arm.@ DEF-upper_arm.@.001 DEF-forearm.@ DEF-forearm.@.001 DEF-hand.@""",
        "L R", "DEF-spine DEF-spine.001 DEF-spine.003 DEF-spine.006 DEF-shoulder.L DEF-upper_arm.L DEF-forearm.L "
        "DEF-hand.L DEF-thigh.L DEF-shin.L DEF-foot.L DEF-toe.L",
    ),
    "AdvancedSkeleton": (
        """Root_M Hip_@ HipPart1_@ Knee_@ KneePart1_@ Ankle_@ Toes_@ ToesEnd_@
        Root_M RootPart1_M Spine1_M Spine1Part1_M Chest_M Neck_M Head_M HeadEnd_M
        Chest_M Scapula_@ Shoulder_@ ShoulderPart1_@ Elbow_@ ElbowPart1_@ Wrist_@ IndexFinger1_@""",
        "L R", "Root_M Spine1_M Chest_M Head_M Scapula_L Shoulder_L Elbow_L Wrist_L Hip_L Knee_L Ankle_L Toes_L",
    ),
    "OpenSim": (
        """pelvis femur_@ tibia_@ talus_@ calcn_@ toes_@
        pelvis torso humerus_@ ulna_@ radius_@ hand_@""",
        "l r", "pelvis - torso - - humerus_l ulna_l hand_l femur_l tibia_l talus_l toes_l",
    ),
    "VRM": (
        """Root J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest J_Bip_C_Neck J_Bip_C_Head J_Sec_Hair1_01
        J_Bip_C_Head J_Sec_Hair1_02 J_Sec_Hair2_02 J_Sec_Hair3_02 J_Sec_Hair4_02 J_Sec_Hair5_02 J_Sec_Hair6_02
        J_Bip_C_Head J_Sec_Hair1_03 J_Sec_Hair2_03 J_Sec_Hair3_03 J_Sec_Hair4_03 J_Sec_Hair5_03 J_Sec_Hair6_03
        J_Bip_C_Head J_Sec_Hair1_04 J_Sec_Hair2_04 J_Sec_Hair3_04 J_Sec_Hair4_04 J_Sec_Hair5_04 J_Sec_Hair6_04
        J_Bip_C_UpperChest J_Bip_@_Shoulder J_Bip_@_UpperArm J_Bip_@_LowerArm J_Bip_@_Hand J_Bip_@_Index1
        J_Bip_C_Hips J_Bip_@_UpperLeg J_Bip_@_LowerLeg J_Bip_@_Foot J_Bip_@_ToeBase""",
        "L R", "J_Bip_C_Hips J_Bip_C_Chest J_Bip_C_UpperChest J_Bip_C_Head J_Bip_L_Shoulder J_Bip_L_UpperArm "
        "J_Bip_L_LowerArm J_Bip_L_Hand J_Bip_L_UpperLeg J_Bip_L_LowerLeg J_Bip_L_Foot J_Bip_L_ToeBase",
    ),
    "Second Life": (
        """mPelvis mSpine1 mSpine2 mTorso mSpine3 mSpine4 mChest mNeck mHead mSkull
        mHead mEye@
        mChest mCollar@ mShoulder@ mElbow@ mWrist@ mHandThumb1@
        mPelvis mHip@ mKnee@ mAnkle@ mFoot@ mToe@
        mPelvis mGroin""",
        "Left Right", "mPelvis mTorso mChest mHead mCollarLeft mShoulderLeft mElbowLeft mWristLeft mHipLeft mKneeLeft "
        "mAnkleLeft mToeLeft",
    ),
    "Auto-Rig Pro": (
        """root.x thigh_stretch.@ leg_stretch.@ foot.@ toes_01.@
        thigh_stretch.@ thigh_twist.@
        leg_stretch.@ leg_twist.@
        root.x spine_01.x spine_02.x spine_03.x neck.x head.x
        spine_03.x shoulder.@ arm_stretch.@ forearm_stretch.@ hand.@ c_index1.@
        arm_stretch.@ arm_twist.@""",
        "l r", "root.x spine_02.x spine_03.x head.x shoulder.l arm_stretch.l forearm_stretch.l hand.l thigh_stretch.l "
        "leg_stretch.l foot.l toes_01.l",
    ),
    "CMU's ASF as BVH": (
        """root @HipJoint @Femur @Tibia @Foot @Toes
        root lowerback upperback thorax lowerneck upperneck head
        thorax @Clavicle @Humerus @Radius @Wrist @Hand @Fingers
        @Wrist @Thumb""",
        "l r", "root upperback thorax head lClavicle lHumerus lRadius lHand lFemur lTibia lFoot lToes",
    ),
    "3ds Max Biped": (
        """Bip01 Bip01_Pelvis Bip01_Spine Bip01_Spine1 Bip01_Spine2 Bip01_Neck Bip01_Head Bip01_HeadNub
        Bip01_Pelvis Bip01_@_Thigh Bip01_@_Calf Bip01_@_Foot Bip01_@_Toe0 Bip01_@_Toe0Nub
        Bip01_Neck Bip01_@_Clavicle Bip01_@_UpperArm Bip01_@_Forearm Bip01_@_Hand Bip01_@_Finger0""",
        "L R", "Bip01_Pelvis Bip01_Spine1 Bip01_Spine2 Bip01_Head Bip01_L_Clavicle Bip01_L_UpperArm Bip01_L_Forearm "
        "Bip01_L_Hand Bip01_L_Thigh Bip01_L_Calf Bip01_L_Foot Bip01_L_Toe0",
    ),
    "MakeHuman": (
        """root spine05 spine04 spine03 spine02 spine01 neck01 neck02 neck03 head
        root pelvis.@ upperleg01.@ upperleg02.@ lowerleg01.@ lowerleg02.@ foot.@ toe5-1.@ toe5-2.@
        foot.@ toe4-1.@ toe4-2.@
        foot.@ toe2-1.@
        foot.@ toe1-1.@
        foot.@ toe3-1.@ toe3-2.@
        spine01 clavicle.@ shoulder01.@ upperarm01.@ upperarm02.@ lowerarm01.@ lowerarm02.@ wrist.@ finger1-1.@""",
        "L R", "root spine03 spine01 head clavicle.L upperarm01.L lowerarm01.L wrist.L upperleg01.L lowerleg01.L "
        "foot.L toe3-1.L",
    ),
    "MakeHuman's links": (
        """Root Spine1 Spine2 Spine3 Neck Head __Jaw Jaw
        Root Hips __UpLeg_@ UpLeg_@ LoLeg_@ Foot_@ Toe_@
        Spine3 __Clavicle_@ Clavicle_@ UpArm_@ LoArm_@ Hand_@ __Index1_@ Index1_@""",
        "L R", "Hips Spine2 Spine3 Head Clavicle_L UpArm_L LoArm_L Hand_L UpLeg_L LoLeg_L Foot_L Toe_L",
    ),
    "Maya's duplicates": (
        """hips_dup spine1_dup spine2_dup spine3_dup neck_dup head_dup
        hips_dup @_hip_dup @_thigh_dup @_knee_dup @_foot_dup @_toes_dup
        spine3_dup @_clavicle_dup @_shoulder_dup @_elbow_dup @_hand_dup""",
        "l r", "hips_dup spine2_dup spine3_dup head_dup l_clavicle_dup l_shoulder_dup l_elbow_dup l_hand_dup "
        "l_thigh_dup l_knee_dup l_foot_dup l_toes_dup",
    ),
    "Kinect": (
        """SpineBase SpineMid SpineShoulder Neck Head
        SpineShoulder Shoulder@ Elbow@ Wrist@ Hand@
        SpineBase Hip@ Knee@ Ankle@ Foot@""",
        "Left Right", "SpineBase SpineMid SpineShoulder Head - ShoulderLeft ElbowLeft HandLeft HipLeft KneeLeft "
        "AnkleLeft FootLeft",
    ),
}  # fmt: skip


@pytest.mark.parametrize("rig", VENDOR_RIGS)
def test_joints_of_vendor_rigs_get_the_expected_roles(rig):
    text, sides, expected = VENDOR_RIGS[rig]
    found = joints_by_role(with_both_sides(text, *sides.split()))
    assert [found.get(part, "-") for part in PARTS] == expected.split()
    assert {part.replace("left", "right") for part in found} == {part.replace("left", "right") for part in found
            if "left" not in part}  # fmt: skip
    bodies = [found[body] for body in BODIES if body in found]
    assert len(set(bodies)) == len(bodies)


@pytest.mark.parametrize(
    ("joint", "side", "bare"),
    [
        ("LFArm", "left", "farm"), ("LF_Arm", "left", "arm"), ("LfArm", "left", "arm"), ("lfemur", "left", "femur"),
        ("leg", "", "leg"), ("ns:rThighBend", "right", "thigh"), ("collar", "", "collar"),
        ("RightUpLeg_055", "right", "upleg"), ("rightforearm", "right", "forearm"), ("lball", "left", "ball"),
        ("Head_M", "", "head"), ("左ひざ", "left", "knee"), ("thigh_stretch.l", "left", "thigh"), ("001", "", ""),
    ],
)  # fmt: skip
def test_joint_name_is_split_into_side_and_word(joint, side, bare):
    sided = frozenset(("arm", "farm", "femur", "leg", "thigh", "collar", "upleg", "forearm", "ball", "knee"))
    (name,) = joint_names((joint,), sided, frozenset(("head",)))
    assert (name.side, name.bare) == (side, bare)


LEGS = "hips @Thigh @Shin @Foot\nhips spine chest neck head\n"


@pytest.mark.parametrize(
    ("arms", "message"),
    [
        ("chest @Arm @Cubitus @Hand", "left_forearm, though leftCubitus is below leftArm"),
        ("chest @Arm @Forearm @Manus", "left_hand, though leftManus is below leftForearm"),
        # A forearm whose parent is the chest does not belong to this arm.
        ("chest @Arm @Middle @Hand\nchest @Forearm", "left_forearm, though leftMiddle is below leftArm"),
    ],
)
def test_arm_with_an_unknown_joint_name_is_refused(arms, message):
    assert roles_of(*tree(with_both_sides(LEGS + arms, "left", "right"))) == message


def test_leg_with_an_unknown_joint_name_is_refused():
    text = with_both_sides("hips @Thigh @Shin @Pes @Toe", "left", "right")
    assert roles_of(*tree(text)) == "left_foot, though leftPes is below leftShin"


def test_joint_directly_below_the_shank_is_the_foot_even_if_named_toe():
    found = joints_by_role(with_both_sides("hips @Thigh @Shin @Toe @ToeEnd\nhips spine chest", "left", "right"))
    assert found["left_foot"] == "leftToe"
    found = joints_by_role(with_both_sides("hips @Thigh @Shin @Foot @Toe\nhips spine chest", "left", "right"))
    assert found["left_foot"] == "leftFoot"


def test_numbered_leg_joints_are_refused():
    """Whether leg 1 is the thigh, or leg 2 its twist, cannot be told."""
    assert roles_of(*tree(with_both_sides("hips @Leg1 @Leg2 @Leg3 @Foot", "left", "right"))) == "left_thigh"


def test_hand_below_the_forearm_of_the_other_side_is_refused():
    joints, parents = tree(with_both_sides(LEGS + "chest @Arm @Forearm", "left", "right"))
    crossed = (*joints, "leftHand", "rightHand")
    parents = (*parents, joints.index("rightForearm"), joints.index("leftForearm"))
    assert roles_of(crossed, parents) == "left_hand, though rightHand is below leftForearm"


def test_complete_rig_has_joints_for_all_bodies_of_the_figure():
    found = joints_by_role(with_both_sides(LEGS + "chest @Shoulder @Arm @Forearm @Hand", "left", "right"))
    assert set(BODIES) <= found.keys()
