import itertools
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from models.errors import ModelError
from models.humanoid.skeleton import BODIES, JOINTS, SEGMENTS, figure_model, rest_pose
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.readers.bvh import read_bvh
from models.mocap.readers.own_bvh import own_clip, write_bvh, write_bvh_blocks


def random_clip(seed, n=60, fps=120.0):
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(n, 18, 4))
    return Clip(np.hstack((rng.normal(size=(n, 3)), quaternions.reshape(n, -1))), fps, "random")


def round_trip(clip, folder):
    path = Path(folder) / "clip.bvh"
    write_bvh(clip, path)
    reloaded = own_clip(read_bvh(path))
    assert reloaded is not None
    return reloaded


def largest_difference(one, other):
    return np.abs(pose_difference(one.poses, other.poses)).max()


def test_random_rotations_survive_the_round_trip(tmp_path):
    clip = random_clip(0)
    reloaded = round_trip(clip, tmp_path)
    assert largest_difference(clip, reloaded) < 1e-9
    assert reloaded.fps == clip.fps
    assert reloaded.name == "clip"


def test_gimbal_lock_orientations_survive_the_round_trip(tmp_path):
    """Every joint at every combination of right angles: each order of Euler angles locks at some of them."""
    right_angles = Rotation.create_group("O").as_quat(scalar_first=True)
    nearly = (Rotation.create_group("O") * Rotation.from_rotvec([3e-9, -2e-9, 1e-9])).as_quat(scalar_first=True)
    poses = np.tile(rest_pose(), (48, 1))
    poses[:, 3:] = np.tile(np.vstack((right_angles, nearly)), 18)
    clip = Clip(poses, 30.0, "right angles")
    assert largest_difference(clip, round_trip(clip, tmp_path)) < 1e-9


@given(
    rotation=st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3),
    joint=st.integers(0, 17),
    fps=st.floats(0.5, 1000.0),
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_joint_rotation_and_frame_rate_survive_the_round_trip(tmp_path, rotation, joint, fps):
    poses = np.tile(rest_pose(), (2, 1))
    poses[:, 3 + 4 * joint : 7 + 4 * joint] = Rotation.from_rotvec(rotation).as_quat(scalar_first=True)
    clip = Clip(poses, fps, "one joint")
    reloaded = round_trip(clip, tmp_path)
    assert largest_difference(clip, reloaded) < 1e-9
    assert reloaded.fps == pytest.approx(fps, rel=5e-5)


def test_forward_kinematics_of_the_file_match_mujoco(tmp_path):
    clip, model = random_clip(4, n=5), figure_model()
    write_bvh(clip, tmp_path / "clip.bvh")
    motion = read_bvh(tmp_path / "clip.bvh")
    positions = motion.global_positions(motion.global_rotations())
    data = mujoco.MjData(model)
    for k in range(5):
        data.qpos[:] = clip.poses[k]
        mujoco.mj_kinematics(model, data)
        # The file is Y up and in centimetres: its (X, Y, Z) are the world's (y, z, x).
        np.testing.assert_allclose(positions[k] / 100, data.xpos[1:][:, [1, 2, 0]], atol=1e-8)


def test_file_has_57_channels_and_the_joints_of_the_figure(tmp_path):
    write_bvh(random_clip(5, n=1), tmp_path / "clip.bvh")
    text = (tmp_path / "clip.bvh").read_text()
    assert sum(int(line.split()[1]) for line in text.splitlines() if "CHANNELS" in line) == 57
    motion = read_bvh(tmp_path / "clip.bvh")
    assert motion.joints == ("root", *JOINTS)
    assert motion.parents == tuple(segment.parent for segment in SEGMENTS)
    assert len(BODIES) == len(motion.joints)


def test_written_angles_do_not_jump_from_frame_to_frame(tmp_path):
    angle = np.linspace(0.0, 6 * np.pi, 200)
    poses = np.tile(rest_pose(), (200, 1))
    poses[:, 3], poses[:, 6] = np.cos(angle / 2), np.sin(angle / 2)
    write_bvh(Clip(poses, 60.0, "spin"), tmp_path / "spin.bvh")
    rows = (tmp_path / "spin.bvh").read_text().split("Frame Time")[1].splitlines()[1:]
    table = np.array([row.split() for row in rows], dtype=np.float64)
    assert np.abs(np.diff(table, axis=0)).max() < 10.0


def test_file_of_the_figure_is_not_retargeted_but_a_scaled_one_is(tmp_path):
    write_bvh(embedded("walk"), tmp_path / "own.bvh")
    assert load(tmp_path / "own.bvh").report is None
    other = tmp_path / "scaled.bvh"
    other.write_text((tmp_path / "own.bvh").read_text().replace("OFFSET 0.000000 -42.44", "OFFSET 0.000000 -43.44"))
    report = load(other).report
    assert report is not None
    assert report.missing == ()
    assert report.taken["left_thigh"] == "left_hip"


def test_writing_in_blocks_gives_the_same_file_as_the_whole_clip(tmp_path: Path) -> None:
    """Angles are continuous across blocks, also where a joint has turned by more than half a turn."""
    clip = embedded("spin")
    write_bvh(clip, tmp_path / "whole.bvh")
    edges = [0, 1, 2, 50, 120, clip.n_frames]
    blocks = (clip.poses[a:b] for a, b in itertools.pairwise(edges))
    write_bvh_blocks(tmp_path / "blocks.bvh", clip.n_frames, clip.fps, blocks)
    assert (tmp_path / "blocks.bvh").read_text() == (tmp_path / "whole.bvh").read_text()


def test_wrong_number_of_frames_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="3 frames were given; expected 4"):
        write_bvh_blocks(tmp_path / "short.bvh", 4, 60.0, [random_clip(1, n=3).poses])
