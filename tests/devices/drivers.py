"""Every driver with a simulated device behind it, for the contract tests and the loop."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sim.devices.dhd import DhdDevice
from sim.devices.driver import Driver
from sim.devices.exchange import Exchange
from sim.devices.hdapi import HdapiDevice
from sim.devices.hid import HidHandle, HidPhantom
from sim.devices.own_device import TipDriver
from sim.devices.spacemouse import SpaceMouse
from sim.users.hand.arm import Arm
from tests.devices.firmware import ROOT, Firmware, FirmwareHandle, compile_c
from tests.devices.hand_made import Cap
from tests.devices.mocks import DhdBackend, HdBackend, mock_dhd, mock_hd
from tests.devices.own_tip import LinkageTip
from tests.devices.rig import DeviceBackend, FirmwareBackend, Linkage, Rig

PUSHES = {20: (0, -250, 120), 220: (0, 40, -40), 300: (0, 0, 0)}
"""Push of the hand on the cap from a tick on; 350 is full deflection."""


class CapBackend:
    """A hand on a SpaceMouse, which sends a report whenever the push changes."""

    def __init__(self, send: Callable[[bytes], None]):
        self._send, self.ticks = send, 0

    def publish_reading(self) -> None:
        if self.ticks in PUSHES:
            self._send(b"\x01" + np.array(PUSHES[self.ticks], "<i2").tobytes())

    def advance(self) -> None:
        self.ticks += 1


def spacemouse_rig(device: Exchange, handle: HidHandle, send: Callable[[bytes], None], transport: str) -> Rig:
    backend = CapBackend(send)
    start = np.array([0.02, 0.01, 0.0])
    mouse = SpaceMouse(handle, "SpaceNavigator", transport, lambda: backend.ticks * 1e-3)
    mouse.start_at(start)
    return Rig(device, mouse, backend)


def _hid(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, DeviceBackend]:
    firmware = Firmware(compile_c(folder, ROOT / "firmware" / "hvf_hid.c"))
    handle = FirmwareHandle(firmware)
    return HidPhantom(handle, "in memory"), FirmwareBackend(firmware, handle, Linkage(arm))


def _hdapi(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, DeviceBackend]:
    backend = HdBackend(mock_hd(folder), Linkage(arm))
    return HdapiDevice(backend.library, clock=lambda: backend.linkage.ticks * 1e-3), backend


def _dhd(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, DeviceBackend]:
    backend = DhdBackend(mock_dhd(folder), Linkage(arm))
    return DhdDevice(backend.library, clock=lambda: backend.linkage.ticks * 1e-3), backend


def _own(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, DeviceBackend]:
    tip = LinkageTip(Linkage(arm))
    return TipDriver(tip, "in memory", clock=lambda: tip.linkage.ticks * 1e-3), tip


_MAKERS = {"hid": _hid, "hdapi": _hdapi, "dhd": _dhd, "own": _own}
KINDS = (*_MAKERS, "spacemouse")
NODE_KINDS = ("hid node", "spacemouse node")
"""Through a /dev/hidraw0 of the kernel or of umockdev, and an unmodified hidapi."""


def make_rig(kind: str, device: Exchange, arm: Arm, folder: Path) -> Rig:
    """A rig with the driver of a kind and the device behind it."""
    if kind == "spacemouse":
        cap = Cap()
        return spacemouse_rig(device, cap, cap.queue.append, "in memory")
    if kind in NODE_KINDS:
        from tests.devices.hidraw_node import missing_reason, node_rig

        if missing_reason():
            pytest.skip(missing_reason())
        return node_rig(kind, device, arm, folder)
    driver, backend = _MAKERS[kind](device, arm, folder)
    return Rig(device, driver, backend)
