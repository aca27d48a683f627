"""How stiff should the river be? One simulation at several gains, two at a time."""

import hvf

curve = hvf.circle(lap=2.0)
sim = hvf.Simulation(
    field=hvf.Follow(curve, k_r=300, b_d=8),
    haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=curve),
    user=hvf.User(pushes=[hvf.Push(at=0.5, seconds=0.5, force=2.0)]),
)
for values, run in hvf.sweep(sim, {"field.k_r": [100, 200, 400]}, seconds=2.0, threads=2):
    print(f"k_r = {values['field.k_r']} N/m: {run.summary.path.deviation_max_mm:.1f} mm at most")
