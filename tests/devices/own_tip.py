"""A user-defined device on the simulated linkage."""

import numpy as np

from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import joint_torques
from sim.devices.own_device import TipDevice, TipPose
from tests.devices.mocks import R_HP_MATRIX, stylus_pose
from tests.devices.rig import Linkage


class LinkageTip(TipDevice):
    """Reports the linkage's tip and applies the force to it."""

    watchdog = True

    def __init__(self, linkage: Linkage):
        self.linkage, self.force, self.reported = linkage, np.zeros(3), True

    def publish_reading(self) -> None:
        self.reported = False

    def advance(self) -> None:
        theta = tuple(self.linkage.angles()[:3])
        force_P = R_HP_MATRIX.T @ self.force
        self.linkage.step(np.add(joint_torques(theta, tuple(force_P)), gravity_torques(theta)))

    def read(self) -> TipPose | None:
        if self.reported:
            return None
        self.reported = True
        p_P, r_HS = stylus_pose(self.linkage.angles())
        return TipPose(R_HP_MATRIX @ p_P, r_HS)

    def write(self, force: np.ndarray) -> None:
        self.force = force

    def release(self) -> None:
        self.force = np.zeros(3)
