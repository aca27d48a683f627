"""Malformed and hostile motion files are refused by the project's own error in one line, in bounded time and memory."""

import json
import re
import time
import tracemalloc

import pytest

from models.mocap.library import load, load_clip
from models.mocap.readers.motion_file import MotionFileError
from tests.models.mocap.readers.motion_files import AMC, ASF, BVH, CHARACTER, DEEPMIMIC, ROW


def refusal(folder, files):
    """The error of loading the last of the files, checked to be one line that says what was expected."""
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(MotionFileError) as caught:
        load(folder / list(files)[-1])
    message = str(caught.value)
    assert "\n" not in message
    assert "; expected " in message
    assert len(message) < 800
    return message.removeprefix(str(folder) + "/")


def test_valid_seed_files_load(tmp_path):
    for name, content in {"s.bvh": BVH, "1.asf": ASF, "1_1.amc": AMC, "d.txt": DEEPMIMIC}.items():
        (tmp_path / name).write_text(content)
    assert [load_clip(tmp_path / name).n_frames for name in ("s.bvh", "1_1.amc", "d.txt")] == [2, 2, 3]


DEEP = "".join(f"JOINT j{k} {{ OFFSET 0 0 0\n" for k in range(100_000))
FRAME = "{}" + AMC[AMC.index("\nroot", AMC.index("\n2\n")) :]


def changed_row(index, value):
    rows = [list(ROW) for _ in range(3)]
    rows[1][index] = value
    return json.dumps({"Frames": rows}, indent=None).replace("], [", "],\n[")


def files_of(file_format, content):
    """Files of a motion by name, the one to load last: one has the content, the others are valid."""
    return {
        "BVH": {"x.bvh": content},
        "ASF": {"1.asf": content, "1_1.amc": AMC},
        "AMC": {"1.asf": ASF, "1_1.amc": content},
        "DeepMimic motion": {"d.txt": content},
        "DeepMimic character": {"a_character.txt": content, "a_walk.txt": DEEPMIMIC},
    }[file_format]


# By format and defect: the content, and how the error begins.
MALFORMED = {
    "BVH": {
        "no hierarchy": ("hello\n", "x.bvh:1: file begins with 'hello'"),
        "no root": (BVH.replace("ROOT", "RUUT"), "x.bvh:2: found 'RUUT'; expected ROOT"),
        "no motion": (BVH[: BVH.index("MOTION")], "x.bvh:18: file ends in the hierarchy; expected MOTION"),
        "something else than motion": (BVH.replace("MOTION", "MUTION"), "x.bvh:19: found 'MUTION'"),
        "unclosed": (BVH[: BVH.index("  JOINT Right")], "x.bvh:11: file ends in the hierarchy; expected }"),
        "nan": (BVH.replace("0 8 0 1", "0 nan 0 1"), "x.bvh:22: 'nan' is not a number"),
        "infinity": (BVH.replace("0 8 1 1", "0 inf 1 1"), "x.bvh:23: 'inf' is not a number"),
        "two roots": (
            BVH.replace("MOTION", "ROOT B\nMOTION"),
            "x.bvh:19: a second ROOT, as of another person; expected one",
        ),
        "overflow": (BVH.replace("0 8 1 1", "0 1e999 1 1"), "x.bvh:23: number '1e999' is too large"),
        "huge": (BVH.replace("0 8 1 1", "0 1e30 1 1"), "x.bvh:23: number '1e30' is too large"),
        "underscores": (BVH.replace("0 8 1 1", "0 1_000 1 1"), "x.bvh:23: '1_000' is not a number"),
        "hexadecimal": (BVH.replace("OFFSET 1 0 0", "OFFSET 0x1 0 0"), "x.bvh:8: '0x1' is not a number"),
        "long digits": (BVH.replace("0 8 1 1", "0 " + "9" * 5000 + " 1 1"), "x.bvh:23: "),
        "arabic digits": (
            BVH.replace("Frames: 2", "Frames: \u0662"),
            "x.bvh:20: number of frames is '\u0662'; expected a whole number",
        ),
        "arabic number": (BVH.replace("0 8 1 1", "0 \u0668 1 1"), "x.bvh:23: '\u0668' is not a number"),
        "short line": (BVH.replace("0 8 1 1", "0 8 1"), "x.bvh:23: frame of 17 numbers; expected 18, one a channel"),
        "long line": (BVH.replace("0 8 1 1", "0 8 1 1 1"), "x.bvh:23: frame of 19 numbers; expected 18, one a channel"),
        "truncated": (
            BVH.replace("0 8 1 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15\n", ""),
            "x.bvh:22: file ends after 1 of 2",
        ),
        "too many lines": (BVH + 2 * ("0 " * 18 + "\n"), "x.bvh:25: more lines than the 2 frames declared"),
        "more than one frame": (
            BVH.replace("Frames: 2", "Frames: 1") + "0 " * 18,
            "x.bvh:24: more lines than the 1 frame declared",
        ),
        "a piece of a line too many": (BVH + "0 " * 17, "x.bvh:24: more lines than the 2 frames declared"),
        "1e9 frames": (BVH.replace("Frames: 2", "Frames: 1000000000"), "x.bvh:20: number of frames is '1000000000'"),
        "many numbers": (
            BVH.replace("Frames: 2", "Frames: 1000000"),
            "x.bvh:20: 1000000 frames of 5 joints, 18000000 numbers",
        ),
        "no frames": (BVH.replace("Frames: 2", "Frames: 0"), "x.bvh:20: 0 frames of 5 joints, 0 numbers"),
        "negative frames": (BVH.replace("Frames: 2", "Frames: -2"), "x.bvh:20: number of frames is '-2'"),
        "frames in words": (BVH.replace("Frames: 2", "Frames: two"), "x.bvh:20: number of frames is 'two'"),
        "no frame count": (BVH.replace("Frames: 2\n", ""), "x.bvh:20: found 'Frame Time: 0.0333333' after MOTION"),
        "no frame time": (BVH.replace("Frame Time: 0.0333333\n", ""), "x.bvh:21: found '0 8 0 1"),
        "frame time zero": (BVH.replace("0.0333333", "0"), "x.bvh:21: frame time is 0 s"),
        "frame time negative": (BVH.replace("0.0333333", "-0.03"), "x.bvh:21: frame time is -0.03 s"),
        "1e9 channels": (
            BVH.replace("CHANNELS 6", "CHANNELS 1000000000"),
            "x.bvh:5: number of channels is '1000000000'",
        ),
        "fewer channels": (BVH.replace("CHANNELS 6", "CHANNELS 5"), "x.bvh:5: found 'Yrotation'"),
        "more channels": (BVH.replace("CHANNELS 3", "CHANNELS 4", 1), "x.bvh:10: channel 'JOINT'"),
        "unknown channel": (BVH.replace("Zrotation", "Wrotation", 1), "x.bvh:5: channel 'Wrotation'"),
        "position twice": (BVH.replace("Yposition", "Xposition"), "x.bvh:5: channel 'Xposition' stands twice"),
        "channels twice": (
            BVH.replace("  JOINT L", "  CHANNELS 1 Xrotation JOINT L", 1),
            "x.bvh:6: joint 'Hips' has CHAN",
        ),
        "no offset": (BVH.replace("    OFFSET 1 0 0\n", ""), "x.bvh:10: joint 'LeftUpLeg' (line 6) has no OFFSET"),
        "joint without a name": (
            BVH.replace("JOINT LeftUpLeg", "JOINT "),
            "x.bvh:6: joint without a name; expected",
        ),
        "root without a name": (BVH.replace("ROOT Hips", "ROOT"), "x.bvh:2: joint without a name; expected"),
        "long offset": (BVH.replace("OFFSET 1 0 0", "OFFSET 1 0 0 0"), "x.bvh:8: found '0'; expected OFFSET, CHANNELS"),
        "offset in words": (BVH.replace("OFFSET -1 0 0", "OFFSET -1 zero 0"), "x.bvh:14: 'zero' is not a number"),
        "offset of a tip": (
            BVH.replace("End Site { OFFSET 0", "End Site { OFFSET o", 1),
            "x.bvh:10: 'o' is not a number",
        ),
        "channels uncounted": (BVH.replace("CHANNELS 6", "CHANNELS"), "x.bvh:5: number of channels is 'Xposition'"),
        "short offset": (BVH.replace("OFFSET 1 0 0", "OFFSET 1 0"), "x.bvh:9: 'CHANNELS' is not a number"),
        "endless name": (BVH.replace("ROOT Hips\n{", "ROOT " + "very " * 99), "x.bvh:2: name 'very very"),
        "1e5 deep": ("HIERARCHY\nROOT a { OFFSET 0 0 0\n" + DEEP, "x.bvh:1002: too many joints; expected at most 1000"),
        "empty": ("", "x.bvh:1: file is empty"),
        "blank": (" \n\t\r\n", "x.bvh:1: file is empty"),
        "binary": (b"HIERARCHY\nROOT\0\0\x01", "x.bvh:2: binary content"),
        "utf-16, malformed": (BVH.replace("0 8 0 1", "0 nan 0 1").encode("utf-16"), "x.bvh:22: 'nan' is not a number"),
        "utf-16 without its mark": (BVH.encode("utf-16-le"), "x.bvh:1: binary content"),
        "utf-16, cut off": (BVH.encode("utf-16")[:-41], "x.bvh:23: "),
        "utf-32": (BVH.encode("utf-32"), "x.bvh:1: binary content"),
        "long text line": (BVH.replace("MOTION", "MOTION" + " " * 2_000_000), "x.bvh:19: line of 2000007 bytes"),
        "control characters": ("\x1b[31mHIERARCHY\n", "x.bvh:1: file begins with"),
        "no length": (BVH.replace("-4", "0"), "x.bvh: the legs have no length"),
        "one leg": (BVH.replace("RightLeg", "Tail"), "x.bvh:1: no joint was found for the right_shank"),
    },
    "ASF": {
        "no bones": (":version 1.10\n", "1.asf: 'every bone' is not in the hierarchy"),
        "a BVH": (BVH, "1.asf: 'every bone' is not in the hierarchy"),
        "section": (ASF.replace(":units", ":untis"), "1.asf:2: section ':untis'"),
        "length nan": (ASF.replace("length 7", "length nan", 1), "1.asf:14: 'nan' is not a number"),
        "length zero": (ASF.replace("0.45", "0"), "1.asf:3: unit of length is '0'"),
        "direction": (ASF.replace("0.3 -0.9 0", "0.3 -0.9", 1), "1.asf:13: 2 numbers; expected three numbers"),
        "axis": (ASF.replace("0 0 20 XYZ", "0 0 20 XYY", 1), "1.asf:15: order of axes 'XYY'"),
        "dof": (ASF.replace("dof rx ry rz", "dof rx rx", 1), "1.asf:16: degrees of freedom 'rx rx'"),
        "sliding dof": (ASF.replace("dof rx ry rz", "dof tx", 1), "1.asf:16: degrees of freedom 'tx'"),
        "same name": (ASF.replace("name rfemur", "name lfemur"), "1.asf:19: bone name 'lfemur'"),
        "unknown child": (ASF.replace("lfemur ltibia\n", "lfemur tail\n"), "1.asf:56: child 'tail'"),
        "cycle": (ASF.replace("    lfemur ltibia\n", "    lfemur root\n"), "1.asf:56: child 'root'"),
        "two parents": (ASF.replace("rfemur rtibia", "rfemur rtibia ltibia"), "1.asf:57: child 'ltibia'"),
        "orphan": (ASF.replace("    rfemur rtibia\n", ""), "1.asf: 'rtibia' is not in the hierarchy"),
        "without a parent": (ASF.replace("    rhipjoint rfemur\n", ""), "1.asf: 'rfemur' is not in the hierarchy"),
        "unknown parent": (ASF.replace("    rfemur rtibia\n", "    rfemr rtibia\n"), "1.asf:57: parent 'rfemr'"),
        "ring": (
            ASF.replace("root lhipjoint rhipjoint", "root rhipjoint\n    ltibia lhipjoint"),
            "1.asf: 'lhipjoint' is below itself",
        ),
        "1e5 bones": (
            ":bonedata\n" + "".join(f"begin\nname b{k}\nend\n" for k in range(100_000)),
            "1.asf:3000: too many",
        ),
        "empty": ("", "1.asf:1: file is empty"),
    },
    "AMC": {
        "no frames": (":DEGREES\n", "1_1.amc:1: no frames"),
        "unknown bone": (AMC.replace("ltibia 7", "tail 7", 1), "1_1.amc:7: found 'tail'"),
        "bone before a frame": ("root 0 0 0 0 0 0\n", "1_1.amc:1: found 'root'"),
        "bone twice": (AMC.replace("rtibia 8", "ltibia 8", 1), "1_1.amc:8: found 'ltibia'"),
        "missing root": (re.sub(r"root .*\n", "", AMC, count=1), "1_1.amc:3: frame without 'root'"),
        "bone missing in one frame": (
            AMC[::-1].replace("\n7 aibitl", "", 1)[::-1],
            "1_1.amc:9: frame without 'ltibia'",
        ),
        "bone in one frame alone": (
            AMC.replace("ltibia 7\n", "", 1),
            "1_1.amc:8: frame with 'ltibia', which none before",
        ),
        "cut off between bones": (
            AMC[: AMC.rindex("ltibia")],
            "1_1.amc:9: frame without 'ltibia'; expected the root and",
        ),
        "cut off after a frame's number": (AMC[: AMC.rindex("root")], "1_1.amc:9: frame without 'root'"),
        "cut off in a bone's name": (
            AMC[: AMC.rindex("ibia")],
            "1_1.amc:14: found 'rt'; expected the number of a frame",
        ),
        "bone without numbers": (
            AMC.replace("rfemur 4 5 6", "rfemur", 1),
            "1_1.amc:6: found 'rfemur'; expected the numb",
        ),
        "frames lost": (AMC + FRAME.format(50), "1_1.amc:15: frame 50 after frame 2; expected 3: frame numbers rise"),
        "frames lost after every second": (
            AMC.replace("\n2\n", "\n3\n") + FRAME.format(6),
            "1_1.amc:15: frame 6 after frame 3; expected 5",
        ),
        "a frame twice": (AMC.replace("\n2\n", "\n1\n"), "1_1.amc:9: frame 1 after frame 1; expected 2"),
        "frame number of 5000 digits": (AMC.replace("\n2\n", "\n" + "2" * 5000 + "\n"), "1_1.amc:9: found '222"),
        "short line": (
            AMC.replace("lfemur 1 2 3", "lfemur 1 2", 1),
            "1_1.amc:5: 'lfemur' has 2 numbers; expected 3: rx ry",
        ),
        "nan": (AMC.replace("rtibia 8", "rtibia nan", 1), "1_1.amc:8: 'nan' is not a number"),
        "word": (AMC.replace("\n2\n", "\ntwo\n"), "1_1.amc:9: found 'two'"),
        "binary": (b"\x00\x01\x02", "1_1.amc:1: binary content"),
    },
    "DeepMimic motion": {
        "broken": ('{"Frames": [[1,', "d.txt:1: JSON: "),
        "list": ("[]", "d.txt:1: JSON is not an object"),
        "no frames": ("{}", "d.txt:1: no list of Frames"),
        "frames a number": ('{"Frames": 3}', "d.txt:1: no list of Frames"),
        "frames empty": ('{"Frames": []}', "d.txt:1: no list of Frames"),
        "row a number": ('{"Frames":\n[3]}', "d.txt:"),
        "short row": (changed_row(0, 0.1).replace(", 0.1]", "]", 2), "d.txt:1: frame 0 has 43 values"),
        "string": (changed_row(5, "1.0"), "d.txt:2: frame 1 has a value that is no number or too large"),
        "null": (changed_row(5, None), "d.txt:2: frame 1"),
        "boolean": (changed_row(5, True), "d.txt:2: frame 1"),
        "list inside": (changed_row(5, [1]), "d.txt:2: frame 1"),
        "nan": (changed_row(5, float("nan")), "d.txt:1: JSON: NaN is not a number"),
        "infinity": (changed_row(5, float("inf")), "d.txt:1: JSON: Infinity is not a number"),
        "overflow": (changed_row(5, 0).replace(" 0,", " 1e999,", 30), "d.txt:1: frame 0"),
        "huge integer": (changed_row(5, 10**400), "d.txt:2: frame 1"),
        "5000 digits": ('{"Frames": [[' + "9" * 5000 + "]]}", "d.txt:1: JSON: "),
        "negative duration": (changed_row(0, -0.1), "d.txt:2: negative duration"),
        "zero duration": (changed_row(0, 0.0), "d.txt:1: frame time is 0 s"),
        "tiny duration": (changed_row(0, 2e-5).replace("[0.1", "[9999", 1), "d.txt:1: "),
        "zero quaternion": (changed_row(4, 0), "d.txt:2: a quaternion is near zero"),
        "nested 1e5": ('{"Frames": ' + "[" * 100_000, "d.txt:1: JSON is nested too deeply"),
        "nested objects": ('{"a":' * 100_000, "d.txt:1: JSON is nested too deeply"),
        "something else": ("once upon a time", "d.txt:1: not a motion file"),
    },
    "DeepMimic character": {
        "no skeleton": ("{}", "a_character.txt:1: no list of joints"),
        "skeleton a list": ('{"Skeleton": [1]}', "a_character.txt:1: no list of joints"),
        "joints a number": ('{"Skeleton": {"Joints": 1}}', "a_character.txt:1: no list of joints"),
        "joint a number": ('{"Skeleton": {"Joints": [1]}}', "a_character.txt:1: joint 0 has Name 'None'"),
        "type": (
            CHARACTER.replace("revolute", "prismatic", 1),
            "a_character.txt:1: joint 2 has Name 'left_knee' and Ty",
        ),
        "type a list": (CHARACTER.replace('"revolute"', '["revolute"]', 1), "a_character.txt:1: joint 2"),
        "own parent": (CHARACTER.replace('"Parent": 1', '"Parent": 2'), "a_character.txt:1: joint 'left_knee': Parent"),
        "no parent": (CHARACTER.replace('"Parent": 1', '"Parent": -1'), "a_character.txt:1: joint 'left_knee': Parent"),
        "parent true": (
            CHARACTER.replace('"Parent": 1', '"Parent": true'),
            "a_character.txt:1: joint 'left_knee': Parent",
        ),
        "attach": (CHARACTER.replace('"AttachY": -0.4', '"AttachY": "x"', 1), "a_character.txt:1: joint 'left_knee'"),
        "two roots": (CHARACTER.replace("spherical", "none", 1), "a_character.txt:1: joint 'left_hip' is of type none"),
        "1e5 joints": (
            json.dumps({"Skeleton": {"Joints": [{}] * 100_000}}),
            'a_character.txt:1: no list of joints; expected "Skeleton": {"Joints": […]}, at most 1000',
        ),
    },
}


@pytest.mark.parametrize(
    ("file_format", "content", "message"),
    [
        pytest.param(file_format, *case, id=f"{file_format}: {defect}")
        for file_format, cases in MALFORMED.items()
        for defect, case in cases.items()
    ],
)
def test_malformed_file_is_refused_in_one_line(tmp_path, file_format, content, message):
    assert refusal(tmp_path, files_of(file_format, content)).startswith(message)


def test_amc_without_skeleton_is_refused_with_the_expected_asf_names(tmp_path):
    assert "1_1.asf or 1.asf" in refusal(tmp_path, {"1_1.amc": AMC})
    assert refusal(tmp_path, {"amc.amc": AMC}).endswith("; expected amc.asf")


def test_file_that_cannot_be_opened_is_refused(tmp_path):
    for name in ("absent.bvh", "absent.amc", "absent.txt"):
        with pytest.raises(MotionFileError, match="; expected "):
            load(tmp_path / name)
    (tmp_path / "folder.bvh").mkdir()
    with pytest.raises(MotionFileError, match="cannot be opened"):
        load(tmp_path / "folder.bvh")
    with pytest.raises(MotionFileError, match="cannot be opened"):
        load(tmp_path / "a\0b.bvh")


def test_control_characters_of_joint_names_are_not_printed(tmp_path):
    (tmp_path / "x.bvh").write_text(BVH.replace("ROOT Hips", "ROOT Hips\x1b[2J"))
    report = load(tmp_path / "x.bvh").report
    assert report is not None
    assert "Hips?[2J as pelvis" in "\n".join(report.lines())
    assert all(line.isprintable() for line in report.lines())


def test_line_break_in_a_file_name_is_not_printed(tmp_path):
    (tmp_path / "two\nlines.bvh").write_text("x")
    with pytest.raises(MotionFileError) as caught:
        load(tmp_path / "two\nlines.bvh")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("frames.bvh", BVH.replace("Frames: 2", "Frames: 999999999")),
        ("lines.bvh", b"\n" * 20_000_000 + b"x"),
        ("blanks.bvh", b" \n" * 400_000 + b"x"),
        ("braces.bvh", "HIERARCHY ROOT a " + "{ " * 400_000),
        ("names.bvh", "HIERARCHY\n" + "ROOT " + "a " * 400_000),
        (
            "still.bvh",
            "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 0\n"
            + "JOINT b { OFFSET 0 0 0 }\n" * 900
            + "}\nMOTION\nFrames: 999999\nFrame Time: 1\n",
        ),
        ("rows.bvh", BVH + "1 " * 450_000),
        ("numbers.amc", AMC + "\n3\nroot " + "1 " * 400_000),
        ("nested.txt", "{" + '"a":[' * 1_000_000),
        ("wide.txt", '{"Frames": [' + "[]," * 1_000_000 + "[]]}"),
    ],
)
def test_hostile_files_are_refused_within_bounds_of_time_and_memory(tmp_path, name, content):
    (tmp_path / "hostile.asf").write_text(ASF)
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    start = time.process_time()
    tracemalloc.start()
    try:
        with pytest.raises(MotionFileError):
            load(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 250e6
    assert time.process_time() - start < 20.0
