"""Joint names by program or vendor."""

# Words for the sides; pelvis, abdomen, chest, neck, head; clavicle, upper arm, forearm, hand, thigh, shank, foot, toe.
# @ stands for the side's word, and ~ for a blank in a name.
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
    "Unity": ("Left Right", "Hips Spine Chest Neck Head",
              "@Shoulder @UpperArm @LowerArm @Hand @UpperLeg @LowerLeg @Foot @Toes"),
    "Biped with blanks": ("L R", "Bip01~Pelvis Bip01~Spine Bip01~Spine1 Bip01~Neck Bip01~Head",
                          "Bip01~@~Clavicle Bip01~@~UpperArm Bip01~@~Forearm Bip01~@~Hand Bip01~@~Thigh Bip01~@~Calf "
                          "Bip01~@~Foot Bip01~@~Toe0"),
    "Biped 2": ("L R", "Bip001~Pelvis Bip001~Spine Bip001~Spine1 Bip001~Neck Bip001~Head",
                "Bip001~@~Clavicle Bip001~@~UpperArm Bip001~@~Forearm Bip001~@~Hand Bip001~@~Thigh Bip001~@~Calf "
                "Bip001~@~Foot Bip001~@~Toe0"),
    "Character Creator": ("L R", "CC_Base_Pelvis CC_Base_Waist CC_Base_Spine02 CC_Base_NeckTwist01 CC_Base_Head",
                          "CC_Base_@_Clavicle CC_Base_@_Upperarm CC_Base_@_Forearm CC_Base_@_Hand CC_Base_@_Thigh "
                          "CC_Base_@_Calf CC_Base_@_Foot CC_Base_@_ToeBase"),
    "Poser": ("l r", "hip abdomen chest neck head", "@Collar @Shldr @ForeArm @Hand @Thigh @Shin @Foot @Toe"),
    "Genesis 9": ("l r", "hip spine1 spine4 neck1 head",
                  "@_shoulder @_upperarm @_forearm @_hand @_thigh @_shin @_foot @_toes"),
    "Xsens as Biovision": ("Left Right", "Hips Chest Chest4 Neck Head",
                           "@Collar @Shoulder @Elbow @Wrist @Hip @Knee @Ankle @Toe"),
    "Kinect": ("Left Right", "SpineBase SpineMid SpineShoulder Neck Head",
               "Clavicle@ Shoulder@ Elbow@ Wrist@ Hip@ Knee@ Ankle@ Foot@"),
    "Azure Kinect": ("LEFT RIGHT", "PELVIS SPINE_NAVEL SPINE_CHEST NECK HEAD",
                     "CLAVICLE_@ SHOULDER_@ ELBOW_@ WRIST_@ HIP_@ KNEE_@ ANKLE_@ FOOT_@"),
    "Perception Neuron": ("Left Right", "Robot_Hips Robot_Spine Robot_Spine3 Robot_Neck Robot_Head",
                          "Robot_@Shoulder Robot_@Arm Robot_@ForeArm Robot_@Hand Robot_@UpLeg Robot_@Leg Robot_@Foot "
                          "Robot_@ToeBase"),
    "Qualisys": ("Left Right", "Q_Hips Q_Spine Q_Spine2 Q_Neck Q_Head",
                 "Q_@Shoulder Q_@Arm Q_@ForeArm Q_@Hand Q_@UpLeg Q_@Leg Q_@Foot Q_@ToeBase"),
    "Move.ai": ("Left Right", "mvnPuppet:Hips mvnPuppet:Spine mvnPuppet:Spine2 mvnPuppet:Neck mvnPuppet:Head",
                "mvnPuppet:@Shoulder mvnPuppet:@Arm mvnPuppet:@ForeArm mvnPuppet:@Hand mvnPuppet:@UpLeg mvnPuppet:@Leg "
                "mvnPuppet:@Foot mvnPuppet:@ToeBase"),
    "Human3.6M": ("L R", "Hip Spine Thorax Neck Head",
                  "@Clavicle @Shoulder @Elbow @Wrist @Hip @Knee @Ankle @Toe"),
    "LaFAN1": ("Left Right", "Hips Spine Spine2 Neck Head",
               "@Shoulder @Arm @ForeArm @Hand @UpLeg @Leg @Foot @Toe"),
    "AMASS": ("left right", "pelvis spine1 spine3 neck head",
              "@_collar @_shoulder @_elbow @_wrist @_hip @_knee @_ankle @_foot"),
    "SMPL in Unity": ("L R", "f_avg_Pelvis f_avg_Spine1 f_avg_Spine3 f_avg_Neck f_avg_Head",
                      "f_avg_@_Collar f_avg_@_Shoulder f_avg_@_Elbow f_avg_@_Wrist f_avg_@_Hip f_avg_@_Knee "
                      "f_avg_@_Ankle f_avg_@_Foot"),
    "SMPL, joints": ("l r", "pelvis spine1 spine3 neck head",
                     "@collar @shoulder @elbow @wrist @hip @knee @ankle @foot"),
    "ARKit": ("left right", "hips_joint spine_1_joint spine_7_joint neck_1_joint head_joint",
              "@_shoulder_1_joint @_arm_joint @_forearm_joint @_hand_joint @_upLeg_joint @_leg_joint @_foot_joint "
              "@_toes_joint"),
    "iPi": ("L R", "Hip LowerSpine Chest Neck Head",
            "@Clavicle @Shoulder @Forearm @Hand @Thigh @Shin @Foot @Toe"),
    "MakeHuman": ("L R", "root spine05 spine01 neck01 head",
                  "clavicle.@ upperarm01.@ lowerarm01.@ wrist.@ upperleg01.@ lowerleg01.@ foot.@ toe1-1.@"),
    "Skyrim": ("L R", "NPC~Pelvis~[Pelv] NPC~Spine~[Spn0] NPC~Spine2~[Spn2] NPC~Neck~[Neck] NPC~Head~[Head]",
               "NPC~@~Clavicle~[@Clv] NPC~@~UpperArm~[@Uar] NPC~@~Forearm~[@Lar] NPC~@~Hand~[@Hnd] NPC~@~Thigh~[@Thg] "
               "NPC~@~Calf~[@Clf] NPC~@~Foot~[@ft~] NPC~@~Toe0~[@Toe]"),
    "SKEL": ("L R", "SKEL_Pelvis SKEL_Spine0 SKEL_Spine3 SKEL_Neck_1 SKEL_Head",
             "SKEL_@_Clavicle SKEL_@_UpperArm SKEL_@_Forearm SKEL_@_Hand SKEL_@_Thigh SKEL_@_Calf SKEL_@_Foot "
             "SKEL_@_Toe0"),
    "mocopi": ("l r", "root torso_1 torso_7 neck_1 head",
               "@_shoulder @_up_arm @_low_arm @_hand @_up_leg @_low_leg @_foot @_toes"),
    "Roblox": ("Left Right", "LowerTorso MiddleTorso UpperTorso Neck Head",
               "@Clavicle @UpperArm @LowerArm @Hand @UpperLeg @LowerLeg @Foot @Toes"),
    "Meta": ("Left Right", "Body_Hips Body_SpineLower Body_Chest Body_Neck Body_Head",
             "Body_@Shoulder Body_@ArmUpper Body_@ArmLower Body_@HandWrist Body_@UpperLeg Body_@LowerLeg "
             "Body_@FootAnkle Body_@FootBall"),
    "DeepMotion": ("l r", "hips_JNT spine_JNT spine2_JNT neck_JNT head_JNT",
                   "@_shoulder_JNT @_arm_JNT @_forearm_JNT @_hand_JNT @_upleg_JNT @_leg_JNT @_foot_JNT @_toebase_JNT"),
    "Nexus": ("L R", "Pelvis Lumbar Thorax Neck Head",
              "@Clavicle @Humerus @Radius @Hand @Femur @Tibia @Foot @Toes"),
    "capitals": ("L R", "HIPS SPINE CHEST NECK HEAD",
                 "SHOULDER_@ UPPERARM_@ FOREARM_@ HAND_@ THIGH_@ SHIN_@ FOOT_@ TOE_@"),
    "sides behind": ("Left Right", "Hips Spine Chest Neck Head",
                     "Shoulder.@ UpperArm.@ ForeArm.@ Hand.@ UpLeg.@ Leg.@ Foot.@ ToeBase.@"),
    "Mixamo, second": ("Left Right", "mixamorig1:Hips mixamorig1:Spine mixamorig1:Spine2 mixamorig1:Neck "
                       "mixamorig1:Head",
                       "mixamorig1:@Shoulder mixamorig1:@Arm mixamorig1:@ForeArm mixamorig1:@Hand mixamorig1:@UpLeg "
                       "mixamorig1:@Leg mixamorig1:@Foot mixamorig1:@ToeBase"),
    "Mixamo in Blender": ("Left Right", "mixamorig_Hips mixamorig_Spine mixamorig_Spine2 mixamorig_Neck mixamorig_Head",
                          "mixamorig_@Shoulder mixamorig_@Arm mixamorig_@ForeArm mixamorig_@Hand mixamorig_@UpLeg "
                          "mixamorig_@Leg mixamorig_@Foot mixamorig_@ToeBase"),
    "CMU for Daz": ("l r", "hip abdomen chest neck head", "@Collar @Shldr @ForeArm @Hand @Thigh @Shin @Foot @Toe"),
    "HumanIK": ("Left Right", "Character1_Hips Character1_Spine Character1_Spine1 Character1_Neck Character1_Head",
                "Character1_@Shoulder Character1_@Arm Character1_@ForeArm Character1_@Hand Character1_@UpLeg "
                "Character1_@Leg Character1_@Foot Character1_@ToeBase"),
}  # fmt: skip
# Joints of trunk and neck in families that have more of them than the figure.
SPINES = {
    "MotionBuilder": "Spine Spine1 Spine2 Spine3 Spine4",
    "Mixamo": "mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2",
    "Rokoko": "Spine1 Spine2 Spine3 Spine4",
    "Xsens": "L5 L3 T12 T8",
    "SMPL": "Spine1 Spine2 Spine3",
    "Unreal": "spine_01 spine_02 spine_03 spine_04 spine_05",
    "Vicon": "lowerback upperback thorax",
    "Xsens as Biovision": "Chest Chest2 Chest3 Chest4",
    "Character Creator": "CC_Base_Waist CC_Base_Spine01 CC_Base_Spine02",
    "Genesis 9": "spine1 spine2 spine3 spine4",
    "ARKit": "spine_1_joint spine_2_joint spine_4_joint spine_6_joint spine_7_joint",
    "AMASS": "spine1 spine2 spine3",
    "LaFAN1": "Spine Spine1 Spine2",
    "Unity": "Spine Chest UpperChest",
    "iPi": "LowerSpine MiddleSpine Chest",
    "mocopi": "torso_1 torso_2 torso_4 torso_6 torso_7",
    "Biped": "Bip01_Spine Bip01_Spine1 Bip01_Spine2 Bip01_Spine3",
    "Biped with blanks": "Bip01~Spine Bip01~Spine1 Bip01~Spine2 Bip01~Spine3",
    "Daz": "abdomenLower abdomenUpper chestLower chestUpper",
    "MakeHuman": "spine05 spine04 spine03 spine02 spine01",
    "VRM": "J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest",
    "Perception Neuron": "Robot_Spine Robot_Spine1 Robot_Spine2 Robot_Spine3",
}
NECKS = {
    "Unreal": "neck_01 neck_02", "Character Creator": "CC_Base_NeckTwist01 CC_Base_NeckTwist02",
    "Vicon": "lowerneck upperneck", "Daz": "neckLower neckUpper", "Genesis 9": "neck1 neck2",
    "MotionBuilder": "Neck Neck1", "LaFAN1": "Neck Neck1", "mocopi": "neck_1 neck_2",
}  # fmt: skip
