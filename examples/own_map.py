"""A user-defined haptic map, in Python: the trunk bows with the stylus's radius, and turns as it goes round."""

import numpy as np

import hvf

ABDOMEN, CHEST = slice(7, 11), slice(11, 15)  # quaternions of a pose: root, abdomen, chest, ...


class Bow(hvf.HapticMap):
    def pose(self, x):  # p_H [m] and R_H (wxyz) -> the figure's 75 numbers
        bow = 12.0 * (np.hypot(x[0], x[1]) - 0.04)  # [rad]
        turn = 0.3 * np.arctan2(x[1], x[0])
        pose = hvf.rest_pose()
        pose[ABDOMEN] = np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)
        pose[CHEST] = np.cos(0.5 * bow), 0.0, np.sin(0.5 * bow), 0.0
        return pose


sim = hvf.Simulation(
    field=hvf.Follow(hvf.circle(lap=4.0), k_r=300, b_d=8),
    haptic_map=Bow(),
    user=hvf.User(pushes=[hvf.Push(at=0.5, seconds=0.5, force=2.5)]),
    figure=hvf.Figure(kind="kinematic"),
)
run = sim.run(1.5)
bow = 2.0 * np.rad2deg(np.arcsin(run.frames["reference"][:, 13]))
print(f"a push bows the trunk from {bow[0]:.1f}° to {bow.max():.1f}°")
