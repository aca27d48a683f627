"""Edit an animation with a push, and keep it as BVH: from a clip to a motion that nobody has authored."""

import tempfile
from pathlib import Path

import hvf

curve = hvf.circle(lap=3.0)
sim = hvf.Simulation(
    field=hvf.Follow(curve, k_r=300, b_d=8),
    haptic_map=hvf.Composite(hvf.clips("squat_dance", "angry", "cheer"), around=curve),
    user=hvf.User(pushes=[hvf.Push(at=1.0, seconds=1.0, force=2.5)]),
)
run = sim.run(3.0)
with tempfile.TemporaryDirectory() as folder:
    path = run.to_bvh(Path(folder) / "edited.bvh")
    changed = run.summary.animation.pushed_deg
    print(f"{path.name}: {hvf.load(path, raw=True).duration:.1f} s; changed by up to {changed:.0f}° a joint")
