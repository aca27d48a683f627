"""A relaxed hand on a river about four clips: what FOLLOW does by itself, and what a push changes."""

import hvf

curve = hvf.circle(radius=0.0477, lap=2.0)
sim = hvf.Simulation(
    field=hvf.Follow(curve, k_r=300, b_d=8),
    haptic_map=hvf.Cylindrical(hvf.clips("squat_dance", "cheer"), around=curve),
    user=hvf.User(pushes=[hvf.Push(at=2.0, seconds=0.6, force=2.5)]),
)
run = sim.run(4.0)
print(run)
print(f"largest force {abs(run.ticks['force']).max():.2f} N")
