"""A device of one's own over the linkage in MuJoCo."""

import numpy as np

from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import joint_torques
from sim.devices.own_device import TipDevice, TipPose
from tests.devices.mocks import R_HP_, pose_of
from tests.devices.rig import Linkage


class LinkageTip(TipDevice):
    """Reports the linkage's tip and pulls at it."""

    watchdog = True

    def __init__(self, linkage: Linkage):
        self.linkage, self.force, self.told = linkage, np.zeros(3), True

    def tell(self) -> None:
        self.told = False

    def move(self) -> None:
        theta = tuple(self.linkage.angles()[:3])
        force_P = R_HP_.T @ self.force
        self.linkage.turn(np.add(joint_torques(theta, tuple(force_P)), gravity_torques(theta)))

    def read(self) -> TipPose | None:
        if self.told:
            return None
        self.told = True
        p_P, r_HS = pose_of(self.linkage.angles())
        return TipPose(R_HP_ @ p_P, r_HS)

    def write(self, force: np.ndarray) -> None:
        self.force = force

    def release(self) -> None:
        self.force = np.zeros(3)
