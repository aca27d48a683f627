"""Compiles and caches the kernels of the guest's driver by a first reading and command on a mock of hidapi."""

import ctypes
import sys

import numpy as np

from sim.devices.exchange import READING_SIZE
from sim.devices.hid import HidPhantom
from sim.devices.hidapi_node import HidapiNode
from tests.devices.firmware import calibration, identity


def main(library: str) -> None:
    mock = ctypes.CDLL(library)
    mock.mock_begin(identity().tobytes(), calibration().tobytes())
    driver = HidPhantom(HidapiNode(mock, "mock"), "mock")
    mock.mock_tick(np.zeros(6, np.int32).tobytes())
    if not driver.read(np.zeros(READING_SIZE), 0.0):
        sys.exit("the mock gave no reading")
    driver.close()


main(sys.argv[1])
