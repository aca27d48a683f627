"""A hand that traces a curve of its own, inside the one that the river follows: how hard it has to work."""

import hvf

curve, inside = hvf.circle(radius=0.0477, lap=2.0), hvf.circle(radius=0.042, lap=2.0)
sim = hvf.Simulation(
    field=hvf.Follow(curve, k_r=150, b_d=8),
    haptic_map=hvf.Cylindrical(hvf.clips("cheer", "angry"), around=curve),
    user=hvf.User(traces=inside),
)
run = sim.run(3.0)
force = (run.ticks["user"][1000:] ** 2).sum(axis=1) ** 0.5
print(f"{1e3 * run.ticks['distance'][1000:].mean():.1f} mm from the river, with {force.mean():.2f} N")
