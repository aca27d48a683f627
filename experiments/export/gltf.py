"""glTF of the figure's motion (glTF 2.0, binary): a skeleton of 18 joints, its animation, and a skin of its shapes.

Axes are those of glTF, Y up and facing +Z, in metres: (x, y, z) of the world W is (X, Y, Z) = (y, z, x) in the file, a
rotation, as in the BVH. The vector part of a quaternion is permuted in the same way, and glTF writes it x, y, z, w.
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from geometry.arrays import Array, IntArray
from geometry.whole_files import atomic_file
from models.errors import ModelError
from models.humanoid.skeleton import SEGMENTS, figure_model, rest_pose
from models.mocap.motion.clip import Clip
from sim.viewer.shapes import body_shapes, simplify_shapes

_AXIS_ORDER = [1, 2, 0]
_FLOAT, _UNSIGNED_BYTE, _UNSIGNED_SHORT, _UNSIGNED_INT = 5126, 5121, 5123, 5125
_VERTEX_TARGET, _INDEX_TARGET = 34962, 34963  # targets of buffer views
_DETAIL_SIZE = 0.003  # [m] size of the finest detail that is kept: half the vertices, without a visible difference


class _Buffer:
    """The binary part of a file, with its buffer views and accessors."""

    def __init__(self, library: Any, document: Any):
        self._library, self._document, self._bytes = library, document, bytearray()

    def add(
        self, values: npt.ArrayLike, kind: str, component: int, target: int | None = None, shares: bool = False
    ) -> int:
        """Append rows of numbers, with `shares` as normalised integers; returns the index of their accessor."""
        dtype = {_FLOAT: "<f4", _UNSIGNED_BYTE: "u1", _UNSIGNED_SHORT: "<u2", _UNSIGNED_INT: "<u4"}[component]
        rows = np.ascontiguousarray(values, dtype=dtype)
        raw = rows.tobytes()
        self._document.bufferViews.append(
            self._library.BufferView(buffer=0, byteOffset=len(self._bytes), byteLength=len(raw), target=target)
        )
        table = rows.reshape(len(rows), -1)
        bounds = {}
        if kind in ("SCALAR", "VEC3") and component == _FLOAT:
            bounds = {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        self._document.accessors.append(
            self._library.Accessor(
                bufferView=len(self._document.bufferViews) - 1, componentType=component, count=len(rows), type=kind,
                normalized=shares, **bounds,
            )
        )  # fmt: skip
        self._bytes += raw + b"\0" * (-len(raw) % 4)
        return len(self._document.accessors) - 1

    def close(self) -> None:
        """Store the bytes in the document."""
        self._document.buffers.append(self._library.Buffer(byteLength=len(self._bytes)))
        self._document.set_binary_blob(bytes(self._bytes))


def write_gltf(clip: Clip, path: Path) -> None:
    """Write a clip as a binary glTF file (.glb).

    Raises
    ------
    ModelError
        If pygltflib is not installed.
    OSError
        If the file cannot be written.
    """
    try:
        import pygltflib
    except ImportError:
        raise ModelError(
            "glTF is written by pygltflib, which is not installed; expected pip install 'haptic-vector-fields[gltf]'"
        ) from None
    library: Any = pygltflib
    document = library.GLTF2(
        asset=library.Asset(version="2.0", generator="haptic vector fields"), scene=0,
        scenes=[library.Scene(nodes=[0, len(SEGMENTS)])], buffers=[], bufferViews=[], accessors=[],
    )  # fmt: skip
    model = figure_model()
    buffer = _Buffer(library, document)
    rest = _add_skeleton(library, document, model, clip)
    _add_skin(library, document, buffer, model, rest)
    _add_motion(library, document, buffer, clip)
    buffer.close()
    with atomic_file(path) as file:
        file.writelines(document.save_to_bytes())


def _add_skeleton(library: Any, document: Any, model: mujoco.MjModel, clip: Clip) -> Array:
    """Add nodes of the joints in the clip's first pose, and of the skin; returns rest positions (18, 3) [m]."""
    positions = np.zeros((len(SEGMENTS), 3))
    for index, segment in enumerate(SEGMENTS):
        offset = np.asarray(model.body(segment.body).pos) if index else rest_pose()[:3]
        positions[index] = offset + (positions[segment.parent] if index else 0.0)
        start = clip.poses[0, :3] if index == 0 else offset
        document.nodes.append(
            library.Node(
                name=segment.joint, translation=start[_AXIS_ORDER].tolist(),
                rotation=_rotations(clip.poses[:1], index)[0].tolist(),
                children=[k for k, other in enumerate(SEGMENTS) if other.parent == index],
            )
        )  # fmt: skip
    document.nodes.append(library.Node(name="figure", mesh=0, skin=0))
    return positions


def _rotations(poses: Array, index: int) -> Array:
    """Local rotations of a joint in glTF's axes and order x, y, z, w, shape (n, 4)."""
    return poses[:, 3 + 4 * index : 7 + 4 * index][:, [2, 3, 1, 0]]


def _add_skin(library: Any, document: Any, buffer: _Buffer, model: mujoco.MjModel, rest: Array) -> None:
    """Add a mesh of the visible shapes of the figure at rest; each vertex is bound to one joint."""
    bodies = {int(model.body(segment.body).id): k for k, segment in enumerate(SEGMENTS)}
    by_color: dict[tuple[float, ...], list[tuple[int, Array, IntArray]]] = {}
    for shape in simplify_shapes(body_shapes(model, ""), _DETAIL_SIZE):
        by_color.setdefault(shape.rgba, []).append((bodies[shape.body], shape.vertices, shape.faces))
    primitives: list[Any] = []
    for color, shapes in by_color.items():
        first = np.cumsum([0] + [len(vertices) for _, vertices, _ in shapes])
        points = np.concatenate([vertices + rest[joint] for joint, vertices, _ in shapes])[:, _AXIS_ORDER]
        joints = np.zeros((len(points), 4))
        joints[:, 0] = np.concatenate([np.full(len(vertices), joint) for joint, vertices, _ in shapes])
        weights = np.tile([255, 0, 0, 0], (len(points), 1))
        faces = np.concatenate([faces + start for (_, _, faces), start in zip(shapes, first[:-1], strict=True)])
        attributes = library.Attributes(
            POSITION=buffer.add(points, "VEC3", _FLOAT, _VERTEX_TARGET),
            JOINTS_0=buffer.add(joints, "VEC4", _UNSIGNED_BYTE, _VERTEX_TARGET),
            WEIGHTS_0=buffer.add(weights, "VEC4", _UNSIGNED_BYTE, _VERTEX_TARGET, shares=True),
        )
        index_type = _UNSIGNED_SHORT if len(points) < 0xFFFF else _UNSIGNED_INT
        indices = buffer.add(faces.ravel(), "SCALAR", index_type, _INDEX_TARGET)
        linear = [share**2.2 for share in color[:3]]  # glTF's colours are linear
        document.materials.append(
            library.Material(
                pbrMetallicRoughness=library.PbrMetallicRoughness(
                    baseColorFactor=[*linear, color[3]], metallicFactor=0.0, roughnessFactor=0.8
                )
            )
        )
        primitives.append(
            library.Primitive(attributes=attributes, indices=indices, material=len(document.materials) - 1)
        )
    document.meshes.append(library.Mesh(name="figure", primitives=primitives))
    inverse = np.tile(np.eye(4), (len(rest), 1, 1))
    inverse[:, :3, 3] = -rest[:, _AXIS_ORDER]
    columns = inverse.transpose(0, 2, 1).reshape(len(rest), 16)
    document.skins.append(
        library.Skin(
            joints=list(range(len(SEGMENTS))), skeleton=0, inverseBindMatrices=buffer.add(columns, "MAT4", _FLOAT)
        )
    )


def _add_motion(library: Any, document: Any, buffer: _Buffer, clip: Clip) -> None:
    times = buffer.add(np.arange(clip.n_frames) / clip.fps, "SCALAR", _FLOAT)
    samplers: list[Any] = []
    channels: list[Any] = []

    def animate(node: int, what: str, values: Array, kind: str) -> None:
        samplers.append(library.AnimationSampler(input=times, output=buffer.add(values, kind, _FLOAT)))
        target = library.AnimationChannelTarget(node=node, path=what)
        channels.append(library.AnimationChannel(sampler=len(samplers) - 1, target=target))

    animate(0, "translation", clip.poses[:, _AXIS_ORDER], "VEC3")
    for index in range(len(SEGMENTS)):
        animate(index, "rotation", _rotations(clip.poses, index), "VEC4")
    document.animations.append(library.Animation(name=clip.name, samplers=samplers, channels=channels))
