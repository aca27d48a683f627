"""Run by a Python that has Blender (bpy): import motions, write where joints are, and export BVH from it.

``python in_blender.py GLB BVH OUT.npz BACK.bvh FPS``
"""

import sys

import bpy
import numpy as np


def joints(fps: float, frames: int, first: int) -> dict[str, np.ndarray]:
    """Heads of the bones in Blender's world, joint by joint, shape (frames, 3)."""
    scene = bpy.context.scene
    armature = next(item for item in bpy.data.objects if item.type == "ARMATURE")
    found: dict[str, list[np.ndarray]] = {bone.name: [] for bone in armature.pose.bones}
    for frame in range(first, first + frames):
        scene.frame_set(frame)
        for bone in armature.pose.bones:
            found[bone.name].append(np.array(armature.matrix_world @ bone.head))
    return {name: np.array(places) for name, places in found.items()}


def empty(fps: float) -> None:
    """Reset to an empty scene at a frame rate."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = round(fps), round(fps) / fps


def main(glb: str, bvh: str, out: str, back: str, fps: float, frames: int) -> None:
    """Import both files, write the joint positions, and export BVH."""
    empty(fps)
    bpy.ops.import_scene.gltf(filepath=glb)
    from_gltf = joints(fps, frames, 0)
    meshes = sum(item.type == "MESH" for item in bpy.data.objects)
    empty(fps)
    bpy.ops.import_anim.bvh(
        filepath=bvh, axis_forward="-Z", axis_up="Y", global_scale=0.01, rotate_mode="NATIVE", frame_start=1,
        use_fps_scale=False,
    )  # fmt: skip
    from_bvh = joints(fps, frames, 1)
    armature = next(item for item in bpy.data.objects if item.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    bpy.ops.export_anim.bvh(
        filepath=back, frame_start=1, frame_end=frames, global_scale=100.0, rotate_mode="NATIVE",
        root_transform_only=True,
    )  # fmt: skip
    names = {f"gltf {name}": places for name, places in from_gltf.items()}
    np.savez(out, meshes=meshes, **names, **{f"bvh {name}": places for name, places in from_bvh.items()})


if __name__ == "__main__":
    main(*sys.argv[1:5], float(sys.argv[5]), int(sys.argv[6]))
