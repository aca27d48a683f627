"""Valid but unusual features of the formats, in files of a few lines."""

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.mocap.library import load
from models.mocap.readers.asf_amc import read_amc
from models.mocap.readers.bvh import read_bvh
from models.mocap.readers.deepmimic import read_deepmimic
from models.mocap.readers.formats import read_motion
from models.mocap.readers.motion_file import MotionFileError
from tests.models.mocap.readers.motion_files import BVH

CHAIN = """HIERARCHY
ROOT Hips
{
\tOFFSET 1.0 2.0 3.0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT Bip01 L Thigh
\t{
\t\tOFFSET 0 -5.9e-014 4
\t\tCHANNELS 3 Yrotation Xrotation Zrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 0 0
\t\t}
\t}
}
MOTION
Frames: 2
Frame Time: .0083333
10 20 30 10 20 30 40 50 60
11 21 31 370 20 30 40 50 -300
"""


def read_text(tmp_path, text, name="motion.bvh"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_motion(path)


def joint_positions(motion):
    return motion.global_positions(motion.global_rotations())


def test_bvh_rotation_order_is_read_for_each_joint(tmp_path):
    motion = read_text(tmp_path, CHAIN)
    root = Rotation.from_euler("ZXY", [10, 20, 30], degrees=True)
    thigh = root * Rotation.from_euler("YXZ", [40, 50, 60], degrees=True)
    turned = Rotation.from_quat(motion.global_rotations()[0], scalar_first=True)
    np.testing.assert_allclose((turned * Rotation.concatenate([root, thigh]).inv()).magnitude(), 0.0, atol=1e-12)
    assert motion.fps == 120.0
    assert motion.joints == ("Hips", "Bip01 L Thigh")


def test_bvh_angles_that_differ_by_a_full_turn_are_the_same_rotation(tmp_path):
    motion = read_text(tmp_path, CHAIN)
    first, second = (Rotation.from_quat(motion.rotations[k], scalar_first=True) for k in (0, 1))
    np.testing.assert_allclose((first * second.inv()).magnitude(), 0.0, atol=1e-12)


def test_bvh_position_channels_replace_the_offset_on_any_joint(tmp_path):
    text = CHAIN.replace("CHANNELS 3 Yrotation", "CHANNELS 4 Zposition Yrotation").replace(" 40 ", " 7 40 ")
    motion = read_text(tmp_path, text)
    np.testing.assert_allclose(motion.translations[0], [[10, 20, 30], [0, -5.9e-14, 7]])
    np.testing.assert_allclose(motion.offsets, [[1, 2, 3], [0, -5.9e-14, 4]])


def test_bvh_position_channels_of_zeros_leave_the_joint_at_its_offset(tmp_path):
    """MakeHuman writes position channels on every joint that are displacements, all of them zero."""
    six_channels = "CHANNELS 6 Xposition Yposition Zposition Yrotation"
    text = CHAIN.replace("CHANNELS 3 Yrotation", six_channels)
    still = read_text(tmp_path, text.replace(" 40 ", " 0 -0.000001 0.0 40 "))
    np.testing.assert_allclose(still.translations, [[[10, 20, 30], [0, 0, 4]], [[11, 21, 31], [0, 0, 4]]], atol=1e-5)
    moved = read_text(tmp_path, text.replace(" 40 ", " 0 3.9 0.7 40 "))
    np.testing.assert_allclose(moved.translations[:, 1], [[0, 3.9, 0.7]] * 2)


def test_bvh_rotation_channels_may_precede_position_channels(tmp_path):
    text = CHAIN.replace(
        "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
        "6 Zrotation Xrotation Yrotation Xposition Yposition Zposition",
    ).replace("10 20 30 10 20 30 40", "10 20 30 10 20 30 40")
    motion, reference = read_text(tmp_path, text), read_text(tmp_path, CHAIN)
    np.testing.assert_allclose(motion.rotations[0], reference.rotations[0])
    np.testing.assert_allclose(motion.translations[0, 0], [10, 20, 30])


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text.replace("\n", "\r\n", 9),
        lambda text: text.rstrip("\n"),
        lambda text: text.replace(" ", "\t").replace("Bip01\tL\tThigh", "Bip01 L Thigh"),
        lambda text: text.replace("\n", "  \t\n"),
        lambda text: text.replace("\n", "\n\n"),
        lambda text: "\ufeff" + text,
        lambda text: ("\ufeff" + text).encode("utf-16-le"),
        lambda text: ("\ufeff" + text.replace("\n", "\r\n")).encode("utf-16-be"),
        lambda text: text.replace("Frames: 2", "Frames:2").replace("Frame Time: .", "Frame Time:\t."),
        lambda text: text.replace("\t\tEnd Site\n\t\t{\n\t\t\tOFFSET 0 0 0\n\t\t}\n", ""),
        lambda text: text.replace("Xrotation", "XROTATION").replace("End Site", "END SITE").replace("ROOT", "Root"),
        lambda text: text.replace("ROOT Hips\n{", "ROOT Hips {"),
    ],
)
def test_bvh_formatting_variants_give_the_same_motion(tmp_path, change):
    np.testing.assert_array_equal(
        joint_positions(read_text(tmp_path, change(CHAIN))), joint_positions(read_text(tmp_path, CHAIN))
    )


def test_bvh_joint_may_have_several_end_sites(tmp_path):
    end = "\t\tEnd Site\n\t\t{\n\t\t\tOFFSET 0 0 0\n\t\t}\n"
    motion = read_text(tmp_path, CHAIN.replace(end, end.replace("0 0 0", "0 -1 -2") + end.replace("0 0 0", "0 -1 5")))
    np.testing.assert_array_equal(motion.tips[1], [0, -1, -2])
    np.testing.assert_array_equal(motion.further_tips[1], [[0, -1, 5]])
    assert motion.of_joints([0, 1]).further_tips.keys() == {1}
    np.testing.assert_array_equal(joint_positions(motion), joint_positions(read_text(tmp_path, CHAIN)))


def test_bvh_with_one_frame_and_position_channels_alone_is_read(tmp_path):
    text = """HIERARCHY
ROOT a
{ OFFSET 0 0 0 CHANNELS 3 Xposition Yposition Zposition
JOINT b { OFFSET 0 1 0 CHANNELS 3 Zposition Yposition Xposition } }
MOTION
Frames: 1
Frame Time: 0.545
1 2 3 4 5 6
"""
    motion = read_text(tmp_path, text)
    np.testing.assert_array_equal(joint_positions(motion)[0], [[1, 2, 3], [7, 7, 7]])
    assert motion.fps == pytest.approx(1 / 0.545)


def test_bvh_translated_joint_need_not_be_the_root(tmp_path):
    text = """HIERARCHY
ROOT reference
{ OFFSET 0 0 0 CHANNELS 3 Zrotation Xrotation Yrotation
JOINT Hips { OFFSET 9 9 9 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation } }
MOTION
Frames: 2
Frame Time: 0.04
90 0 0 1 0 0 0 0 0
90 0 0 2 0 0 0 0 0
"""
    np.testing.assert_allclose(joint_positions(read_text(tmp_path, text))[:, 1], [[0, 1, 0], [0, 2, 0]], atol=1e-15)


def test_bvh_frame_beyond_the_declared_number_is_read_and_remarked(tmp_path):
    motion = read_text(tmp_path, CHAIN.replace("Frames: 2", "Frames: 1"))
    np.testing.assert_array_equal(joint_positions(motion), joint_positions(read_text(tmp_path, CHAIN)))
    assert motion.remarks == ("the file has 2 frames, one more than the 1 it declares: the last one is read, too",)
    assert read_text(tmp_path, CHAIN).remarks == ()


def test_bvh_frame_that_lost_numbers_repeats_the_one_before(tmp_path):
    """At 25 frames a second two in a row may, as they last less than 0.1 s; the first frame has none before."""
    rows = ["0 0 0 1 2 3 4 5 6\n", "0 nan 0 1 2 3 4 5 7\n", "0 0 0 NaN -nan 3 4 5 8\n", "0 0 1 1 2 3 4 5 9\n"]
    whole = CHAIN[: CHAIN.index("Frames:")] + "Frames: 4\nFrame Time: 0.04\n"
    motion = read_text(tmp_path, whole + "".join(rows))
    np.testing.assert_array_equal(motion.rotations[1:3], motion.rotations[[0, 0]])
    np.testing.assert_array_equal(motion.translations[1:3], motion.translations[[0, 0]])
    line = whole.count("\n") + 2
    assert motion.remarks == (f"2 frames lack numbers (nan), the first in line {line}",)
    for order, lost in (([1, 0, 0, 3], 1), ([0, 1, 1, 1], 4)):
        with pytest.raises(MotionFileError, match=f":{line - 2 + lost}: 'nan' is not a number"):
            read_text(tmp_path, whole + "".join(rows[k] for k in order))


def test_bvh_whose_angles_may_be_in_radians_is_remarked(tmp_path):
    """No angle exceeds a full turn in radians; a single frame, often the rest pose, is not remarked."""
    angles = re.compile(r"(?<=\d )10 20 30 40 50 60\n|370 20 30 40 50 -300\n")
    radians = angles.sub("0.1 0.2 0.3 0.4 0.5 -6.28\n", CHAIN)
    for text, remarked in ((CHAIN, False), (radians, True), (one_frame(radians), False)):
        assert any("if these are radians" in remark for remark in read_text(tmp_path, text).remarks) == remarked


def one_frame(text):
    """The first of two frames alone."""
    return text.replace("Frames: 2", "Frames: 1").rsplit("11 21", 1)[0]


def test_remarks_of_a_reader_are_in_the_report(tmp_path):
    (tmp_path / "motion.bvh").write_text(BVH.replace("Frames: 2", "Frames: 1"))
    report = load(tmp_path / "motion.bvh").report
    assert report is not None
    assert "the file has 2 frames, one more than the 1 it declares: the last one is read, too" in report.lines()


def test_bvh_frame_time_gives_a_whole_rate_only_if_it_is_that_rate_rounded(tmp_path):
    rates = {".0083333": 120.0, "0.033333": 30.0, "0.016667": 60.0, "0.008342": 1 / 0.008342, "0.0417083750417": 23.976}
    for written, rate in rates.items():
        assert read_text(tmp_path, CHAIN.replace(".0083333", written)).fps == pytest.approx(rate, rel=1e-9), written


ASF = """# skeleton
:version 1.10
:name test
:units
  mass 1.0
  length 0.45
  angle {angle}
:documentation
   begin anything at all
:root
   order {order}
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name thigh
     direction 0 -1 0
     length 2
     axis {axis} XYZ
    dof rx rz
    limits (-10 10)
           (-20 20)
  end
  begin
     id 2
     name shank
     direction 0 -1 0
     length 3
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root thigh
    thigh shank
  end
"""
AMC = ":FULLY-SPECIFIED\n:{mode}\n1\nroot {root}\nthigh {thigh}\n2\nroot {root}\nthigh {thigh}\n"


def read_acclaim(tmp_path, asf, amc):
    (tmp_path / "7.asf").write_bytes(asf.encode())
    (tmp_path / "7_03.amc").write_bytes(amc.encode())
    return read_amc(tmp_path / "7_03.amc")


def test_amc_in_radians_with_another_order_and_crlf_is_the_same_motion(tmp_path):
    degrees = read_acclaim(
        tmp_path,
        ASF.format(angle="deg", order="TX TY TZ RX RY RZ", axis="10 20 30"),
        AMC.format(mode="DEGREES", root="1 2 3 40 50 60", thigh="15 -25"),
    )
    turn, hinge = np.deg2rad([40, 50, 60]), np.deg2rad([15, -25])
    radians = read_acclaim(
        tmp_path,
        ASF.format(angle="rad", order="RZ TY RX RY TX TZ", axis="{} {} {}".format(*np.deg2rad([10, 20, 30]))),
        AMC.format(mode="RADIANS", root=f"{turn[2]} 2 {turn[0]} {turn[1]} 1 3", thigh=f"{hinge[0]} {hinge[1]}").replace(
            "\n", "\r\n"
        ),
    )
    np.testing.assert_allclose(joint_positions(radians), joint_positions(degrees), atol=1e-12)
    root = Rotation.from_euler("xyz", [40, 50, 60], degrees=True)
    own = Rotation.from_euler("xyz", [10, 20, 30], degrees=True)
    thigh = own * Rotation.from_euler("xz", [15, -25], degrees=True) * own.inv()
    np.testing.assert_allclose(
        joint_positions(degrees)[0, 2], np.array([1, 2, 3]) + (root * thigh).apply([0, -2, 0]), atol=1e-12
    )
    np.testing.assert_allclose(degrees.tips[2], [0, -3, 0])
    assert (degrees.fps, degrees.timed) == (120.0, False)


def test_asf_hierarchy_lines_may_be_in_any_order(tmp_path):
    asf = ASF.format(angle="deg", order="TX TY TZ RX RY RZ", axis="10 20 30")
    amc = AMC.format(mode="DEGREES", root="1 2 3 40 50 60", thigh="15 -25")
    turned = asf.replace("    root thigh\n    thigh shank\n", "    thigh shank\n    root thigh\n")
    assert turned != asf
    np.testing.assert_array_equal(
        joint_positions(read_acclaim(tmp_path, turned, amc)), joint_positions(read_acclaim(tmp_path, asf, amc))
    )


def test_amc_frame_numbers_may_start_anywhere_with_any_constant_step(tmp_path):
    asf = ASF.format(angle="deg", order="TX TY TZ RX RY RZ", axis="10 20 30")
    amc = AMC.format(mode="DEGREES", root="1 2 3 40 50 60", thigh="15 -25")
    reference = read_acclaim(tmp_path, asf, amc)
    every_second = read_acclaim(tmp_path, asf, amc.replace("\n1\n", "\n100\n").replace("\n2\n", "\n102\n"))
    np.testing.assert_array_equal(joint_positions(every_second), joint_positions(reference))


def test_amc_bone_without_values_is_not_rotated_and_remarked(tmp_path):
    asf = ASF.format(angle="deg", order="TX TY TZ RX RY RZ", axis="10 20 30")
    amc = AMC.format(mode="DEGREES", root="1 2 3 40 50 60", thigh="15 -25").replace("thigh 15 -25\n", "")
    motion = read_acclaim(tmp_path, asf, amc)
    np.testing.assert_allclose(motion.rotations[:, 1], [[1, 0, 0, 0]] * 2, atol=1e-12)
    assert motion.remarks == ("'thigh' has no values in any frame: it is taken as unrotated",)


def deepmimic_row(duration, x, turn):
    half = turn / 2
    return [duration, x, 1.0, 0.0, np.cos(half), 0.0, np.sin(half), 0.0, *([1.0, 0, 0, 0] * 3), 0.0,
            *([1.0, 0, 0, 0] * 2), 0.0, *([1.0, 0, 0, 0]), 0.0, *([1.0, 0, 0, 0] * 2), 0.0]  # fmt: skip


def test_deepmimic_quaternions_are_normalised_and_their_signs_made_continuous(tmp_path):
    rows = [deepmimic_row(0.02, 0.0, 0.1 * k) for k in range(4)]
    rows[2] = [*rows[2][:4], *(-1.7 * value for value in rows[2][4:8]), *rows[2][8:]]
    rows[-1][0] = 0.0
    (tmp_path / "m.txt").write_text(json.dumps({"Loop": "wrap", "Frames": rows}))
    motion = read_deepmimic(tmp_path / "m.txt")
    np.testing.assert_allclose(motion.rotations[:, 0, 2], np.sin(0.05 * np.arange(4)), atol=1e-12)
    assert motion.fps == 50.0


def test_deepmimic_rows_of_unequal_duration_are_resampled(tmp_path):
    times = np.array([0.0, 0.02, 0.06, 0.1])
    rows = [deepmimic_row(d, 5 * t, t) for d, t in zip([*np.diff(times), 0.0], times, strict=True)]
    (tmp_path / "m.json").write_text(json.dumps({"Frames": rows}))
    motion = read_deepmimic(tmp_path / "m.json")
    assert motion.n_frames == 6
    np.testing.assert_allclose(motion.translations[:, 0, 0], 5 * 0.02 * np.arange(6), atol=1e-12)
    np.testing.assert_allclose(2 * np.arcsin(motion.rotations[:, 0, 2]), 0.02 * np.arange(6), atol=1e-6)


def test_format_is_detected_by_content_if_the_suffix_is_ambiguous(tmp_path):
    assert read_text(tmp_path, CHAIN, name="motion.txt").joints[0] == "Hips"
    text = json.dumps({"Frames": [deepmimic_row(0.1, 0.0, 0.0)]})
    assert read_text(tmp_path, text, name="motion").joints[0] == "root"


def test_bvh_joint_names_in_latin_1_are_read(tmp_path):
    motion = read_text(tmp_path, CHAIN.encode().replace(b"Hips", "Hüfte".encode("latin-1")))
    assert motion.joints[0].startswith("H")
    assert read_bvh(tmp_path / "motion.bvh").n_frames == 2
