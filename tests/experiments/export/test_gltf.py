"""glTF and BVH of the figure in Blender: joint positions agree, and BVH round-trips without loss."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from experiments.cli import main
from geometry.arrays import Array
from models.humanoid.skeleton import SEGMENTS, figure_model
from models.mocap.library import embedded, load
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.readers.own_bvh import write_bvh

pytest.importorskip("pygltflib")

FRAMES = 40
BLENDER = os.environ.get("BLENDER_PYTHON", sys.executable)  # a separate Python, for bpy needs an older NumPy


def joints_of(clip: Clip) -> Array:
    """Places of the joints, shape (n, 18, 3)."""
    model = figure_model()
    data = mujoco.MjData(model)
    places: list[Array] = []
    for pose in clip.poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        places.append(data.xpos[1:].copy())
    return np.array(places)


def glb(path: Path) -> tuple[dict, bytes]:
    """The two parts of a binary glTF file, read without a library for it."""
    raw = path.read_bytes()
    magic, version, length, n, kind = struct.unpack_from("<4sIIII", raw)
    assert (magic, version, length, kind) == (b"glTF", 2, len(raw), 0x4E4F534A)
    return json.loads(raw[20 : 20 + n]), raw[28 + n :]


def rows(document: dict, binary: bytes, accessor: int) -> Array:
    item = document["accessors"][accessor]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[item["type"]]
    view = document["bufferViews"][item["bufferView"]]
    dtype = np.dtype({5126: "<f4", 5121: "u1", 5123: "<u2", 5125: "<u4"}[item["componentType"]])
    values = np.frombuffer(binary, dtype, item["count"] * width, view.get("byteOffset", 0))
    largest = np.iinfo(dtype).max if item.get("normalized") else 1.0
    return values.reshape(item["count"], width).astype(float) / largest


def test_animated_nodes_reproduce_joint_positions(tmp_path: Path) -> None:
    clip, file = embedded("backflip"), tmp_path / "flip.glb"
    write_bvh(clip, tmp_path / "flip.bvh")
    assert main(["convert", str(tmp_path / "flip.bvh"), str(file)]) == 0
    document, binary = glb(file)
    motion = document["animations"][0]
    tracks = {
        (channel["target"]["node"], channel["target"]["path"]): motion["samplers"][channel["sampler"]]
        for channel in motion["channels"]
    }
    places = joints_of(clip)
    times = rows(document, binary, tracks[0, "translation"]["input"])[:, 0]
    np.testing.assert_allclose(times, np.arange(clip.n_frames) / clip.fps, atol=1e-6)
    for frame in (0, clip.n_frames // 3, clip.n_frames - 1):
        found: dict[int, tuple[Array, Array]] = {}

        def visit(node: int, place: Array, turn: Array, found=found, frame=frame) -> None:
            item = document["nodes"][node]
            moved = tracks.get((node, "translation"))
            offset = rows(document, binary, moved["output"])[frame] if moved else np.array(item["translation"])
            x, y, z, w = rows(document, binary, tracks[node, "rotation"]["output"])[frame]
            local = np.empty(9)
            mujoco.mju_quat2Mat(local, np.array([w, x, y, z]))
            here = place + turn @ offset
            found[node] = here, turn @ local.reshape(3, 3)
            for child in item.get("children", []):
                visit(child, here, found[node][1])

        visit(0, np.zeros(3), np.eye(3))
        for node, (place, _) in found.items():
            assert document["nodes"][node]["name"] == SEGMENTS[node].joint
            np.testing.assert_allclose(place[[2, 0, 1]], places[frame, node], atol=2e-6)


def test_skin_is_the_figure_at_rest_with_one_joint_per_vertex(tmp_path: Path) -> None:
    from experiments.export.gltf import write_gltf

    write_gltf(embedded("walk"), tmp_path / "walk.glb")
    assert (tmp_path / "walk.glb").stat().st_size < 2e6
    document, binary = glb(tmp_path / "walk.glb")
    points: list[Array] = []
    for primitive in document["meshes"][0]["primitives"]:
        vertices, joints, weights = (
            rows(document, binary, primitive["attributes"][name]) for name in ("POSITION", "JOINTS_0", "WEIGHTS_0")
        )
        indices = rows(document, binary, primitive["indices"])
        assert indices.max() < len(vertices)
        assert joints.max() < len(SEGMENTS)
        np.testing.assert_array_equal(weights, np.tile([1.0, 0.0, 0.0, 0.0], (len(vertices), 1)))
        points.append(vertices)
    every = np.concatenate(points)
    low, high = every.min(axis=0), every.max(axis=0)
    assert abs(low[1]) < 2e-3  # soles on the floor
    assert high[1] == pytest.approx(1.75, abs=0.03)
    assert high[0] == pytest.approx(-low[0], abs=1e-3)  # left and right


def test_existing_file_is_not_replaced_without_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_bvh(embedded("walk"), tmp_path / "walk.bvh")
    (tmp_path / "walk.glb").write_bytes(b"mine")
    assert main(["convert", str(tmp_path / "walk.bvh"), str(tmp_path / "walk.glb")]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "walk.glb").read_bytes() == b"mine"


@pytest.mark.slow
def test_blender_reproduces_joint_positions_and_its_bvh_round_trips(tmp_path: Path) -> None:
    if subprocess.run([BLENDER, "-c", "import bpy"], capture_output=True, check=False).returncode:
        pytest.skip("no Blender: BLENDER_PYTHON names no Python that can import bpy (pip install 'bpy==4.5.*')")
    from experiments.export.gltf import write_gltf

    whole = embedded("jump")
    clip = Clip(whole.poses[:FRAMES], whole.fps, "jump")
    paths = [tmp_path / name for name in ("jump.glb", "jump.bvh", "joints.npz", "back.bvh")]
    write_gltf(clip, paths[0])
    write_bvh(clip, paths[1])
    script = Path(__file__).with_name("in_blender.py")
    command = [BLENDER, str(script), *map(str, paths), str(clip.fps), str(FRAMES)]
    completed = subprocess.run(command, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    places = joints_of(clip)
    expected = np.stack((places[..., 1], -places[..., 0], places[..., 2]), axis=-1)  # Blender's axes: facing −Y
    with np.load(paths[2]) as in_blender:
        assert in_blender["meshes"] >= 1
        for kind in ("gltf", "bvh"):
            for k, segment in enumerate(SEGMENTS):
                distance = np.linalg.norm(in_blender[f"{kind} {segment.joint}"] - expected[:, k], axis=1)
                assert distance.max() < 1e-3, (kind, segment.joint)
    back = load(paths[3])
    assert back.report is None  # it is the figure's own skeleton, not another's
    difference = pose_difference(back.clip.poses, clip.poses)
    assert np.abs(difference[:, :3]).max() < 1e-4
    assert np.abs(difference[:, 3:]).max() < np.deg2rad(0.05)
