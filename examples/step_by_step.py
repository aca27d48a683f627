"""Step a simulation tick by tick, and stop when the stylus is half way round."""

import math

import hvf

curve = hvf.circle(lap=2.0)
sim = hvf.Simulation(
    field=hvf.Follow(curve, k_r=300, b_d=8), haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=curve)
)
for tick in sim:
    x, y, _ = tick.hand.p
    if abs(math.atan2(y, x)) > 3.0:
        print(f"half way after {tick.hand.t:.2f} s, force {tick.force.round(2)} N, pelvis {tick.figure[2]:.2f} m up")
        break
