"""Mocks of vendor libraries built from C, and simulated devices behind them."""

import abc
import ctypes
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import R_HP, forward_kinematics, joint_torques, stylus_orientation
from sim.devices.dhd import DHD
from sim.devices.hdapi import HDAPI
from tests.devices.firmware import compile_c
from tests.devices.rig import Linkage

R_HP_MATRIX = np.array(R_HP)
HERE = Path(__file__).parent
R_HD = np.diag([-1.0, -1.0, 1.0])


def mock_hd(folder: Path) -> ctypes.CDLL:
    path = compile_c(folder, HERE / "mock_hd.c")
    library = HDAPI.load(str(path))
    library.mock_velocity.argtypes = [ctypes.c_double] * 3
    library.mock_temperature.argtypes = [ctypes.c_double]
    library.mock_frames.restype = ctypes.c_ulong
    library.mock_reset()
    return library


def mock_dhd(folder: Path) -> ctypes.CDLL:
    library = DHD.load(str(compile_c(folder, HERE / "mock_dhd.c")))
    library.mock_reset()
    return library


def motor_force(library: ctypes.CDLL) -> np.ndarray:
    buffer = (ctypes.c_double * 3)()
    library.mock_force(buffer)
    return np.array(buffer)


def stylus_pose(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tip in P [m] and the stylus's orientation in H (3, 3)."""
    q = stylus_orientation(angles[:3], angles[3:])
    return np.array(forward_kinematics(angles[:3])), Rotation.from_quat(q, scalar_first=True).as_matrix()


class VendorBackend(abc.ABC):
    """A linkage whose pose a library reports and which its force moves; such a device balances its own weight."""

    def __init__(self, library: ctypes.CDLL, linkage: Linkage):
        self.library, self.linkage = library, linkage

    @abc.abstractmethod
    def publish_reading(self) -> None:
        """Give the library the linkage's pose."""

    @abc.abstractmethod
    def force_P(self) -> np.ndarray:
        """Force that was commanded through the library [N], in P."""

    def advance(self) -> None:
        theta = tuple(self.linkage.angles()[:3])
        self.linkage.step(np.add(joint_torques(theta, tuple(self.force_P())), gravity_torques(theta)))


class HdBackend(VendorBackend):
    def publish_reading(self) -> None:
        p_P, r_HS = stylus_pose(self.linkage.angles())
        transform = np.eye(4)
        transform[:3, :3], transform[:3, 3] = R_HP_MATRIX.T @ r_HS @ R_HP_MATRIX, 1e3 * p_P
        self.library.mock_pose((ctypes.c_double * 16)(*transform.T.ravel()))
        self.library.mock_tick()

    def force_P(self) -> np.ndarray:
        return motor_force(self.library)


class DhdBackend(VendorBackend):
    def publish_reading(self) -> None:
        p_P, r_HS = stylus_pose(self.linkage.angles())
        p_D, frame = R_HD @ R_HP_MATRIX @ p_P, R_HD @ r_HS @ R_HD
        self.library.mock_pose((ctypes.c_double * 3)(*p_D), (ctypes.c_double * 9)(*frame.ravel()))

    def force_P(self) -> np.ndarray:
        return R_HP_MATRIX.T @ R_HD @ motor_force(self.library)
