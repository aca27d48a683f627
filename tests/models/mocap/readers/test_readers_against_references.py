"""Joint positions against third-party readers, or against an independent derivation where there is none."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import quaternions
from models.mocap.readers.asf_amc import read_amc
from models.mocap.readers.bvh import read_bvh
from models.mocap.readers.deepmimic import read_deepmimic
from models.mocap.readers.formats import read_motion

LONG_FILES = (
    "animated_drawings/jumping.bvh", "animated_drawings/wave_hello.bvh", "cmu_amc/01_01.bvh", "cmu_bvh/131_03.bvh",
    "cmu_bvh/scaled_131_03.bvh", "snu/pirouette.bvh",
)  # fmt: skip
SHORT_FILES = (
    "quirks/Geno_stance.bvh", "quirks/beeveeh_rotate_hip.bvh", "quirks/bvh_test2.bvh", "quirks/bvh_test3.bvh",
    "quirks/bvhio_example.bvh", "quirks/fairmotion_sinusoidal.bvh", "quirks/pfnn_hierarchy.bvh",
    "quirks/pybvh_full_precision_frame_time.bvh", "quirks/pybvh_rotation_first_root.bvh", "snu/backflip.bvh",
    "snu/cart.bvh", "snu/dance.bvh", "snu/hpgit_backflip.bvh", "snu/kick.bvh", "snu/run.bvh", "snu/walk.bvh",
    "xia/angry_13_000.bvh", "xia/dme_example.bvh", "xia/strutting_01_000.bvh", "xia/xia_rest_1frame.bvh",
)  # fmt: skip
BVH_FILES = LONG_FILES + SHORT_FILES
POSITION_CHANNELS_ON_EVERY_JOINT = "quirks/Geno_stance.bvh"  # pybvh refuses it


def stature(motion):
    zero = motion.offsets.copy()
    for joint, parent in enumerate(motion.parents):
        zero[joint] += zero[parent] if parent >= 0 else -zero[joint]
    return np.linalg.norm(np.ptp(zero, axis=0))


def positions_of(motion):
    return motion.global_positions(motion.global_rotations())


def test_list_of_bvh_files_is_complete(mocap):
    assert sorted(str(path.relative_to(mocap)) for path in mocap.glob("**/*.bvh")) == sorted(BVH_FILES)


@pytest.mark.parametrize("name", [name for name in BVH_FILES if name != POSITION_CHANNELS_ON_EVERY_JOINT])
@pytest.mark.filterwarnings("ignore:Rest pose suggests")
def test_bvh_joint_positions_match_pybvh(mocap, name):
    pybvh = pytest.importorskip("pybvh")
    motion, reference = read_bvh(mocap / name), pybvh.read_bvh_file(str(mocap / name))
    assert list(motion.joints) == reference.joint_names
    assert np.abs(positions_of(motion) - reference.joint_positions()).max() <= 1e-6 * stature(motion)
    assert motion.fps == pytest.approx(1.0 / reference.frame_time, rel=5e-5)


@pytest.mark.parametrize("name", [*SHORT_FILES, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG_FILES)])
def test_bvh_joint_positions_match_bvhio(mocap, name):
    bvhio = pytest.importorskip("bvhio")
    motion = read_bvh(mocap / name)
    reference, positions = bvhio.readAsHierarchy(str(mocap / name)), positions_of(motion)
    for frame in sorted({0, motion.n_frames // 2, motion.n_frames - 1}):
        reference.loadPose(frame)
        expected = {joint.Name: np.array(joint.PositionWorld) for joint, _, _ in reference.layout()}
        for joint, position in zip(motion.joints, positions[frame], strict=True):
            # It computes in single precision: seven digits of wherever the figure stands.
            error = np.abs(position - expected[joint]).max()
            assert error <= 1e-6 * stature(motion) + 2e-7 * np.abs(position).max(), (frame, joint)


def matrix_positions(asf: Path, amc: Path):
    """Joint positions of an ASF/AMC by regular expressions and matrices, bone by bone, as in Lander's description."""
    import re

    text = asf.read_text().replace("\r", "")
    bones = {}
    for block in re.findall(r"begin\s+id.*?end", text.split(":bonedata")[1].split(":hierarchy")[0], re.S):
        name = re.search(r"name (\S+)", block)[1]
        direction = np.array(re.search(r"direction (\S+) (\S+) (\S+)", block).groups(), dtype=float)
        axis = np.array(re.search(r"axis (\S+) (\S+) (\S+)", block).groups(), dtype=float)
        dof = re.search(r"dof (.*)", block)
        bones[name] = (
            direction * float(re.search(r"length (\S+)", block)[1]),
            Rotation.from_euler("xyz", axis, degrees=True).as_matrix(),
            [] if dof is None else ["xyz".index(word[1]) for word in dof[1].split()],
        )
    children = {line.split()[0]: line.split()[1:] for line in text.split(":hierarchy")[1].splitlines() if line.strip()}
    frames = re.split(r"\n\d+ *\n", amc.read_text().replace("\r", ""))[1:]
    for frame in frames:
        values = {line.split()[0]: np.array(line.split()[1:], dtype=float) for line in frame.strip().splitlines()}
        root = values["root"]
        places = {"root": root[:3]}

        def place_children(parent, start, turn, values=values, places=places):
            for name in children.get(parent, []):
                bone, axis, dof = bones[name]
                angles = np.zeros(3)
                angles[dof] = values.get(name, np.zeros(0))
                child_rotation = turn @ axis @ Rotation.from_euler("xyz", angles, degrees=True).as_matrix() @ axis.T
                places[name] = start
                place_children(name, start + child_rotation @ bone, child_rotation)

        place_children("root", root[:3], Rotation.from_euler("xyz", root[3:], degrees=True).as_matrix())
        yield places


@pytest.mark.parametrize("name", ["02_01", "02_03", "02_04", "16_09"])
def test_amc_joint_positions_match_an_independent_derivation(mocap, name):
    folder = mocap / "cmu_amc"
    motion = read_amc(folder / f"{name}.amc")
    positions = positions_of(motion)
    n_frames = 0
    for k, places in enumerate(matrix_positions(folder / f"{name[:2]}.asf", folder / f"{name}.amc")):
        n_frames += 1
        if k % 20 == 0:
            expected = np.array([places[joint] for joint in motion.joints])
            assert np.abs(positions[k] - expected).max() <= 1e-6 * stature(motion)
    assert motion.n_frames == n_frames
    assert motion.fps == 120.0
    assert motion.unit == pytest.approx(0.0254 / 0.45)


def test_amc_and_bvh_of_one_motion_have_equal_bone_rotations(mocap):
    """The BVH prepends a frame, and leaves out the bone from thorax to neck; rotations and legs are the same."""
    amc, bvh = read_amc(mocap / "cmu_amc/01_01.amc"), read_bvh(mocap / "cmu_amc/01_01.bvh")
    assert bvh.n_frames == amc.n_frames + 1
    names = {
        "root": "Hips", "lfemur": "LeftUpLeg", "ltibia": "LeftLeg", "lfoot": "LeftFoot", "ltoes": "LeftToeBase",
        "rfemur": "RightUpLeg", "rtibia": "RightLeg", "rfoot": "RightFoot", "lowerback": "LowerBack", "head": "Head",
        "upperback": "Spine", "thorax": "Spine1", "lclavicle": "LeftShoulder", "lhumerus": "LeftArm",
        "lradius": "LeftForeArm", "lwrist": "LeftHand", "lhand": "LeftFingerBase", "rradius": "RightForeArm",
    }  # fmt: skip
    amc_rotations, bvh_rotations = amc.global_rotations(), bvh.global_rotations()[1:]
    amc_positions, bvh_positions = amc.global_positions(amc_rotations), positions_of(bvh)[1:]
    for bone, joint in names.items():
        i, j = amc.joints.index(bone), bvh.joints.index(joint)
        turns = quaternions.product(quaternions.conjugate(amc_rotations[:, i]), bvh_rotations[:, j])
        # Angles have four decimals of a degree in one file and six digits in the other.
        assert np.linalg.norm(quaternions.logarithm(turns), axis=1).max() < 2e-5, bone
        if bone in ("root", "lfemur", "ltibia", "lfoot", "ltoes"):
            assert np.abs(amc_positions[:, i] - bvh_positions[:, j]).max() < 2e-4, bone


def test_deepmimic_joint_positions_match_an_independent_derivation(mocap):
    """Scipy's rotations along the chains of the character file, by name."""
    import json

    character = json.loads((mocap / "deepmimic/humanoid3d_character.txt").read_text())["Skeleton"]["Joints"]
    for path in sorted((mocap / "deepmimic").glob("humanoid3d_*.txt")):
        if path.stem.endswith("character"):
            continue
        rows = json.loads(path.read_text())["Frames"]
        motion = read_deepmimic(path)
        positions = positions_of(motion)
        assert motion.n_frames == len(rows)
        assert motion.fps == pytest.approx(1.0 / rows[0][0], rel=5e-5)
        for k in range(0, len(rows), 7):
            column, places, turns = 4, {}, {}
            for joint in character:
                attach = np.array([joint[f"Attach{axis}"] for axis in "XYZ"])
                if joint["Type"] == "none":
                    start, turn = np.array(rows[k][1:4]), Rotation.identity()
                else:
                    start, turn = places[joint["Parent"]], turns[joint["Parent"]]
                places[joint["ID"]] = start + turn.apply(attach)
                if joint["Type"] == "revolute":
                    turn = turn * Rotation.from_rotvec([0.0, 0.0, rows[k][column]])
                    column += 1
                elif joint["Type"] in ("none", "spherical"):
                    turn = turn * Rotation.from_quat(rows[k][column : column + 4], scalar_first=True)
                    column += 4
                turns[joint["ID"]] = turn
            expected = np.array([places[joint["ID"]] for joint in character])
            assert np.abs(positions[k] - expected).max() <= 1e-6 * 1.6, path.name


def test_default_deepmimic_humanoid_matches_the_character_file(mocap, tmp_path):
    original = mocap / "deepmimic/humanoid3d_walk.txt"
    (tmp_path / "walk.txt").write_bytes(original.read_bytes())
    with_file, without = read_motion(original), read_motion(tmp_path / "walk.txt")
    assert with_file.joints == without.joints
    assert with_file.parents == without.parents
    np.testing.assert_allclose(with_file.offsets, without.offsets, atol=1e-9)
    np.testing.assert_allclose(with_file.rotations, without.rotations, atol=1e-12)
