"""Small valid motion files of every format, from which tests derive malformed ones."""

import json

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftLeg { OFFSET 0 -4 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 -4 0 } }
  }
  JOINT RightUpLeg
  {
    OFFSET -1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT RightLeg { OFFSET 0 -4 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 -4 0 } }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
0 8 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15
0 8 1 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15
"""
ASF = """:version 1.10
:units
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     name lfemur
     direction 0.3 -0.9 0
     length 7
     axis 0 0 20 XYZ
     dof rx ry rz
  end
  begin
     name rfemur
     direction -0.3 -0.9 0
     length 7
     axis 0 0 -20 XYZ
     dof rx ry rz
  end
  begin
     name ltibia
     direction 0.3 -0.9 0
     length 7
     axis 0 0 20 XYZ
     dof rx
  end
  begin
     name rtibia
     direction -0.3 -0.9 0
     length 7
     axis 0 0 -20 XYZ
     dof rx
  end
  begin
     name lhipjoint
     direction 1 0 0
     length 1
     axis 0 0 0 XYZ
  end
  begin
     name rhipjoint
     direction -1 0 0
     length 1
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root lhipjoint rhipjoint
    lhipjoint lfemur
    rhipjoint rfemur
    lfemur ltibia
    rfemur rtibia
  end
"""
AMC = """:FULLY-SPECIFIED
:DEGREES
1
root 0 16 0 1 2 3
lfemur 1 2 3
rfemur 4 5 6
ltibia 7
rtibia 8
2
root 0 16 1 1 2 3
lfemur 1 2 3
rfemur 4 5 6
ltibia 7
rtibia 8
"""
ROW = [0.1, 0, 1, 0, *([1, 0, 0, 0] * 4), 0.1, *([1, 0, 0, 0] * 2), 0.1, *([1, 0, 0, 0]), 0.1, *([1, 0, 0, 0] * 2), 0.1]
DEEPMIMIC = json.dumps({"Loop": "none", "Frames": [ROW, ROW, ROW]})
CHARACTER = json.dumps(
    {
        "Skeleton": {
            "Joints": [
                {"Name": "root", "Type": "none", "Parent": -1, "AttachX": 0, "AttachY": 0, "AttachZ": 0},
                {"Name": "left_hip", "Type": "spherical", "Parent": 0, "AttachX": 0, "AttachY": 0, "AttachZ": -0.1},
                {"Name": "left_knee", "Type": "revolute", "Parent": 1, "AttachX": 0, "AttachY": -0.4, "AttachZ": 0},
                {"Name": "right_hip", "Type": "spherical", "Parent": 0, "AttachX": 0, "AttachY": 0, "AttachZ": 0.1},
                {"Name": "right_knee", "Type": "revolute", "Parent": 3, "AttachX": 0, "AttachY": -0.4, "AttachZ": 0},
            ]
        }
    }
)
