"""A user-defined device in the loop: `hvf hardware run --device own_device.py:Mass …` opens this class.

In place of real hardware it is a mass that moves by the force it is given, held by nobody.
"""

import time

import numpy as np

import hvf


class Mass(hvf.TipDevice):
    largest_force = 3.0  # [N]

    def __init__(self):  # here a real device is opened; an error says why it cannot be
        self.p, self.v, self.force = np.array([0.0477, 0.0, 0.0]), np.zeros(3), np.zeros(3)
        self.last = time.perf_counter()

    def read(self):  # the tip [m] in the hand frame: x away from the user, y to the left, z up
        now = time.perf_counter()
        step, self.last = min(now - self.last, 0.01), now
        self.v = self.v + step * (self.force - 1.0 * self.v) / 0.2  # 0.2 kg, 1 N s/m
        self.p = self.p + step * self.v
        return hvf.TipPose(self.p, pressed=True)

    def write(self, force):  # [N], in the hand frame
        self.force = force

    def release(self):
        self.force = np.zeros(3)


if __name__ == "__main__":
    device = Mass()
    device.write(np.array([-1.0, 0.0, 0.0]))
    for _ in range(100):
        time.sleep(0.001)
        position = device.read().position
    print(f"1 N moved it by {1e3 * (0.0477 - position[0]):.0f} mm in a tenth of a second")
