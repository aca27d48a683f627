"""A robot arm in place of the figure: a river leads the stylus, and the arm's tool follows it, twice as far."""

import numpy as np

import hvf

curve = hvf.circle(radius=0.03, lap=2.0)
sim = hvf.Simulation(
    field=hvf.Follow(curve, k_r=300, b_d=8),
    haptic_map=hvf.RobotArm(around=curve, scale=2.0),
    user=hvf.User(pushes=[hvf.Push(at=2.5, seconds=0.5, force=2.0)]),
)
run = sim.run(4.0)
print(run)
swept = np.degrees(np.ptp(run.frames["joints"], axis=0))
print(f"The joints turn through {swept.min():.0f} to {swept.max():.0f}°.")
