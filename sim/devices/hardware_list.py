"""Discovery of connected devices, and opening a driver by device name.

| name | what it opens |
|---|---|
| `hid:SERIAL`, or `hid` if there is only one | a Phantom that speaks the open HID protocol |
| `hidraw:PATH` | the same, by its device node |
| `spacemouse`, `spacemouse:PATH` | a 3Dconnexion SpaceMouse |
| `hdapi`, `hdapi:NAME` | an OpenHaptics device, by its name in the vendor's configuration |
| `dhd` | a Force Dimension device |
| `FILE.py:CLASS` | a user-defined device (`sim.devices.own_device`) |
"""

import contextlib
import ctypes
import importlib
import os
import sys
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

from sim.devices import hid_protocol as protocol
from sim.devices.dhd import DHD, DhdDevice
from sim.devices.driver import Driver
from sim.devices.hdapi import HDAPI, HdapiDevice
from sim.devices.hid import HidHandle, HidPhantom
from sim.devices.hidapi_node import HidapiNode
from sim.devices.own_device import is_own_device, open_own_device, own_device_class
from sim.devices.spacemouse import SpaceMouse
from sim.errors import SimError

_TOUCH_IDS = (0x2988, 0x0304)  # USB vendor and product of the Touch
_CONNEXION_VENDOR, _LOGITECH_VENDOR = 0x256F, 0x046D
_GENERIC_DESKTOP, _MULTI_AXIS = 0x01, 0x08
_BUSES = {1: "usb", 2: "bluetooth", 3: "i2c", 4: "spi"}  # hidapi's hid_bus_type

RULES_FILE = "/etc/udev/rules.d/70-hvf.rules"
"""Numbered below 73, the rule by which systemd gives nodes tagged `uaccess` to the user logged in at the machine."""


@dataclass(frozen=True)
class FoundDevice:
    """A device found on this machine.

    Parameters
    ----------
    name : str
        Name for `open_device`; empty if there is no driver for the device.
    bus, transport, path : str
        Such as usb, hidraw, /dev/hidraw3.
    vendor_id, product_id : int
        0 where the transport has none.
    vendor, product, serial : str
        As reported by the device.
    kind : str
        ``phantom``, ``spacemouse``, ``touch``, ``vendor`` (behind a vendor's library) or ``other``.
    note : str
        What the user has to know or do about it.
    usable : bool
        Whether this user has permission to open it.
    """

    name: str
    bus: str
    transport: str
    path: str
    vendor_id: int
    product_id: int
    vendor: str
    product: str
    serial: str
    kind: str
    note: str
    usable: bool

    def where(self) -> str:
        """Bus, vendor and product number, transport and path, in columns."""
        ids = f"{self.vendor_id:04x}:{self.product_id:04x}" if self.vendor_id else "-"
        return f"{self.bus or '-':9} {ids:9} {self.transport:7} {self.path}"

    def maker_and_product(self) -> str:
        """Vendor and product, as the device reports them."""
        return " ".join(filter(None, (self.vendor, self.product)))

    def udev_rule(self) -> str:
        """The udev rule that gives this device's node to the user logged in at the machine."""
        ids = f'ATTRS{{idVendor}}=="{self.vendor_id:04x}", ATTRS{{idProduct}}=="{self.product_id:04x}"'
        return f'KERNEL=="hidraw*", SUBSYSTEM=="hidraw", {ids}, MODE="0660", TAG+="uaccess"'


def hid_backend() -> Any:
    """The hidapi module that uses the kernel's HID nodes: `hidraw` on Linux, `hid` elsewhere.

    Raises
    ------
    SimError
        If it is not installed.
    """
    name = "hidraw" if sys.platform.startswith("linux") else "hid"
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SimError("the package hidapi is not installed; install it with: pip install hidapi") from None


def list_devices() -> list[FoundDevice]:
    """All devices found on this machine; none is opened and nothing is sent to any of them."""
    found = [_hid_device(row) for row in hid_backend().enumerate()]
    for name, transport, find, product in (
        ("hdapi", "HDAPI", HDAPI.find, "3D Systems Touch or Phantom"),
        ("dhd", "DHD", DHD.find, "Force Dimension omega, delta, sigma or Novint Falcon"),
    ):
        path = find()
        if path is not None:
            note = "the library is installed; whether a device is connected shows when it is opened"
            found.append(FoundDevice(name, "", transport, path, 0, 0, "", product, "", "vendor", note, True))
    return found


def _hid_device(row: dict[str, Any]) -> FoundDevice:
    path = row["path"].decode(errors="replace")
    ids, usage = (row["vendor_id"], row["product_id"]), (row["usage_page"], row["usage"])
    serial = row["serial_number"] or ""
    name, kind, note = "", "other", "not a device that moves a stylus"
    if ids == _TOUCH_IDS:
        kind = "touch"
        note = "its HID reports are not public, so nothing is sent to it; use hdapi, with OpenHaptics installed"
    elif usage == (protocol.USAGE_PAGE, protocol.USAGE):
        name, kind, note = f"hid:{serial}" if serial else f"hidraw:{path}", "phantom", "speaks the open HID protocol"
    elif ids[0] in (_CONNEXION_VENDOR, _LOGITECH_VENDOR) and usage == (_GENERIC_DESKTOP, _MULTI_AXIS):
        name, kind, note = f"spacemouse:{path}", "spacemouse", "six axes in, no force out"
    usable = not path.startswith("/") or os.access(path, os.R_OK | os.W_OK)
    if kind in ("phantom", "spacemouse") and not usable:
        note = f"no permission to open {path}; `hvf hardware doctor` prints the udev rule"
    return FoundDevice(
        name, _BUSES.get(row.get("bus_type", 0), "?"), "hidraw", path, *ids, row["manufacturer_string"] or "",
        row["product_string"] or "", serial, kind, note, usable,
    )  # fmt: skip


def open_hid(path: str) -> HidHandle:
    """Open a node with hidapi's Python binding.

    Raises
    ------
    SimError
        If it cannot be opened; the message says what to do about it.
    """
    handle = hid_backend().device()
    with _explain_open_failure(path):
        handle.open_path(path.encode())
    return handle


def open_node(path: str) -> HidHandle | HidapiNode:
    """Open a node with hidapi's C functions or, where the package does not export them, with its Python binding.

    Raises
    ------
    SimError
        As `open_hid`.
    """
    library = ctypes.CDLL(hid_backend().__file__)
    if not hasattr(library, "hid_read_timeout"):
        return open_hid(path)
    with _explain_open_failure(path):
        return HidapiNode(library, path)


@contextlib.contextmanager
def _explain_open_failure(path: str) -> Generator[None, None, None]:
    """Replace an OSError by a `SimError` that says why the node cannot be opened."""
    try:
        yield
    except OSError:
        if os.path.exists(path) and not os.access(path, os.R_OK | os.W_OK):
            raise SimError(f"no permission to open {path}; `hvf hardware doctor` prints the udev rule") from None
        raise SimError(f"{path} cannot be opened: it was unplugged, or another program uses it") from None


def open_device(name: str) -> Driver:
    """Open the driver of a device by its name (see the table of this module).

    Raises
    ------
    SimError
        If there is no such device (the message lists those found), or it cannot be opened.
    DriverFault
        If the device does not answer as it should.
    """
    if is_own_device(name):
        return open_own_device(name)
    check_present(name)
    kind, _, rest = name.partition(":")
    openers: dict[str, Callable[[str], Driver]] = {
        "hid": _open_phantom, "hidraw": _open_phantom, "spacemouse": _open_spacemouse,
        "hdapi": lambda which: HdapiDevice(HDAPI.load(), which), "dhd": lambda _: DhdDevice(DHD.load()),
    }  # fmt: skip
    return openers[kind](rest)


def check_present(name: str) -> None:
    """Check that a name denotes a device that is present, or whose library is installed, without opening it.

    Raises
    ------
    SimError
        If it does not; the message lists the devices found.
    """
    if is_own_device(name):
        own_device_class(name)
        return
    kind, _, rest = name.partition(":")
    checks: dict[str, Callable[[], object]] = {
        "hid": lambda: _single_device(rest, "phantom", name), "hidraw": lambda: _single_device(rest, "phantom", name),
        "spacemouse": lambda: _single_device(rest, "spacemouse", name), "hdapi": HDAPI.path, "dhd": DHD.path,
    }  # fmt: skip
    if kind not in checks or (kind == "hidraw" and not rest) or (kind == "dhd" and rest):
        raise SimError(f"no device is called {name!r}; {_describe_devices()}")
    checks[kind]()


def _describe_devices() -> str:
    names = [device.name for device in list_devices() if device.name]
    kinds = "expected hid[:SERIAL], hidraw:PATH, spacemouse[:PATH], hdapi[:NAME], dhd or FILE.py:CLASS"
    return f"{kinds}; found here: {', '.join(names) if names else 'none'}"


def _single_device(which: str, kind: str, name: str) -> FoundDevice:
    """The device of a kind by serial number or path, or the only one if `which` is empty; `name` is for messages."""
    connected = list_devices()
    for device in connected:
        if which and which in (device.serial, device.path) and device.kind != kind:
            raise SimError(f"{which} is {device.product or 'a device'}, no {kind}: {device.note}")
    matches = [device for device in connected if device.kind == kind and which in ("", device.serial, device.path)]
    if len(matches) != 1:
        raise SimError(f"{len(matches) or 'no'} devices are connected for {name!r}; {_describe_devices()}")
    return matches[0]


def _open_phantom(which: str) -> Driver:
    device = _single_device(which, "phantom", f"hid:{which}")
    return HidPhantom(open_node(device.path), device.path)


def _open_spacemouse(which: str) -> Driver:
    device = _single_device(which, "spacemouse", f"spacemouse:{which}")
    return SpaceMouse(open_hid(device.path), device.product, device.path)
