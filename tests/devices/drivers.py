"""Every driver with what is real behind it, for the loop: what the contract of a device is tested on."""

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
from tests.devices.firmware import ROOT, Firmware, FirmwareHandle, compiled
from tests.devices.mocks import BehindDhd, BehindHd, mock_dhd, mock_hd
from tests.devices.own_tip import LinkageTip
from tests.devices.rig import Behind, FirmwareBehind, Linkage, Rig
from tests.devices.test_spacemouse import Cap

PUSHES = {20: (0, -250, 120), 220: (0, 40, -40), 300: (0, 0, 0)}
"""What a hand does on the cap, by tick: 350 is all the way."""


class CapBehind:
    """A hand on a SpaceMouse, which sends a report when the push changes."""

    def __init__(self, send: Callable[[bytes], None]):
        self._send, self.ticks = send, 0

    def tell(self) -> None:
        if self.ticks in PUSHES:
            self._send(b"\x01" + np.array(PUSHES[self.ticks], "<i2").tobytes())

    def move(self) -> None:
        self.ticks += 1


def spacemouse_rig(device: Exchange, handle: HidHandle, send: Callable[[bytes], None], transport: str) -> Rig:
    behind = CapBehind(send)
    start = np.array([0.02, 0.01, 0.0])
    mouse = SpaceMouse(handle, "SpaceNavigator", transport, lambda: behind.ticks * 1e-3, start)
    return Rig(device, mouse, behind)


def _hid(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, Behind]:
    firmware = Firmware(compiled(folder, ROOT / "firmware" / "hvf_hid.c"))
    handle = FirmwareHandle(firmware)
    return HidPhantom(handle, "in memory"), FirmwareBehind(firmware, handle, Linkage(arm))


def _hdapi(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, Behind]:
    behind = BehindHd(mock_hd(folder), Linkage(arm))
    return HdapiDevice(behind.library, clock=lambda: behind.linkage.ticks * 1e-3), behind


def _dhd(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, Behind]:
    behind = BehindDhd(mock_dhd(folder), Linkage(arm))
    return DhdDevice(behind.library, clock=lambda: behind.linkage.ticks * 1e-3), behind


def _own(device: Exchange, arm: Arm, folder: Path) -> tuple[Driver, Behind]:
    tip = LinkageTip(Linkage(arm))
    return TipDriver(tip, "in memory", clock=lambda: tip.linkage.ticks * 1e-3), tip


_MAKERS = {"hid": _hid, "hdapi": _hdapi, "dhd": _dhd, "own": _own}
KINDS = (*_MAKERS, "spacemouse")
NODE_KINDS = ("hid node", "spacemouse node")
"""Through /dev/hidraw0, the kernel's or umockdev's, and hidapi as it comes."""


def made_rig(kind: str, device: Exchange, arm: Arm, folder: Path) -> Rig:
    """The driver of a kind in the loop of an exchange."""
    if kind == "spacemouse":
        cap = Cap()
        return spacemouse_rig(device, cap, cap.queue.append, "in memory")
    if kind in NODE_KINDS:
        from tests.devices.hidraw_node import node_rig, why_not

        if why_not():
            pytest.skip(why_not())
        return node_rig(kind, device, arm, folder)
    driver, behind = _MAKERS[kind](device, arm, folder)
    return Rig(device, driver, behind)
