"""Devices behind a /dev/hidraw0 that an unmodified hidapi opens: the test's side of `node_server.py`."""

import functools
import json
import os
import socket
import subprocess
from pathlib import Path

from sim.devices import hid_protocol as protocol
from sim.devices.exchange import Exchange
from sim.devices.hardware_list import open_device, open_hid
from sim.users.hand.arm import Arm
from tests.devices.drivers import spacemouse_rig
from tests.devices.firmware import ROOT, Firmware, compile_c
from tests.devices.rig import Linkage, Rig

SYSTEM_PYTHON = "/usr/bin/python3"
PRELOAD = "libumockdev-preload.so.0"
SPACEMOUSE_DESCRIPTOR = bytes.fromhex("05010908a101850109300931093216a2fe265e0175109503810285020933093409358102c0")


@functools.cache
def umockdev_missing() -> str:
    """Why there is no umockdev here; empty where there is one."""
    probe = "import gi; gi.require_version('UMockdev', '1.0'); from gi.repository import UMockdev"
    try:
        probed = subprocess.run([SYSTEM_PYTHON, "-c", probe], capture_output=True, timeout=30)
    except OSError:
        return f"no {SYSTEM_PYTHON}"
    return "umockdev, python3-gi or gir1.2-umockdev-1.0 is not installed" if probed.returncode else ""


def missing_reason() -> str:
    """Why this process cannot create nodes; empty where it can."""
    if PRELOAD not in os.environ.get("LD_PRELOAD", ""):
        return umockdev_missing() or "run by tests/devices/test_hidraw_nodes.py, which loads umockdev before"
    return ""


class HidrawNode:
    """A /dev/hidraw0 that this process sees, with packets in and out.

    Parameters
    ----------
    descriptor : bytes
        HID report descriptor.
    vendor, product : int
    name, serial : str
    """

    def __init__(self, descriptor: bytes, vendor: int, product: int, name: str, serial: str = ""):
        self._socket, theirs = socket.socketpair()
        self._server = subprocess.Popen(
            [SYSTEM_PYTHON, str(Path(__file__).parent / "node_server.py"), str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
        )
        theirs.close()
        self._buffer, self._written = b"", []
        self._send(descriptor=descriptor.hex(), vendor=vendor, product=product, name=name, serial=serial)
        os.environ["UMOCKDEV_DIR"] = self._receive("directory")

    def _send(self, **message: object) -> None:
        self._socket.sendall(json.dumps(message).encode() + b"\n")

    def _receive(self, key: str):
        """Wait for the next answer with a key; reports that were written meanwhile are collected."""
        while True:
            while b"\n" not in self._buffer:
                chunk = self._socket.recv(65536)
                assert chunk, "the node's server has ended"
                self._buffer += chunk
            line, self._buffer = self._buffer.split(b"\n", 1)
            message = json.loads(line)
            if "written" in message:
                self._written.append(bytes.fromhex(message["written"]))
            if key in message:
                return message[key]

    def post(self, packet: bytes) -> None:
        """Send an input report, which can be read once this returns."""
        self._send(packet=packet.hex())
        self._receive("done")

    def feature(self, number: int, report: bytes) -> None:
        """Set the answer to requests of a feature report."""
        self._send(feature=[number, report.hex()])
        self._receive("done")

    def unplug(self) -> None:
        self._send(gone=True)
        self._receive("done")

    def written(self) -> list[bytes]:
        """Output and feature reports since the last call."""
        self._send(feature=[255, ""])  # answered after all of them
        self._receive("done")
        taken, self._written = self._written, []
        return taken

    def close(self) -> None:
        self._socket.close()
        try:
            self._server.wait(10)
        except subprocess.TimeoutExpired:  # umockdev sometimes waits for a client that has gone
            self._server.kill()
            self._server.wait()


class NodeFirmware:
    """The reference firmware on the simulated linkage, behind a node."""

    def __init__(self, folder: Path, arm: Arm | None = None, period: float = 1e-3):
        self.firmware, self.period = Firmware(compile_c(folder, ROOT / "firmware" / "hvf_hid.c")), period
        self.linkage = Linkage(arm)
        self.node = HidrawNode(self.firmware.descriptor(), 0x16C0, 0x0486, "Reference", "HVF-0001")
        self._features()

    def _features(self) -> None:
        for number in (protocol.IDENTITY, protocol.CALIBRATION):
            self.node.feature(number, self.firmware.feature(number))

    def publish_reading(self) -> None:
        self.firmware.turn_to(self.linkage.angles())
        self.node.post(self.firmware.tick(self.period))

    def receive_commands(self) -> bool:
        """Pass written reports to the firmware; returns whether there were any."""
        reports = self.node.written()
        for report in reports:
            self.firmware.take(report)
        return bool(reports)

    def advance(self) -> None:
        self.receive_commands()
        self.linkage.step(self.firmware.joint_torque)

    def power_up(self, calibrated: bool) -> None:
        self.firmware.power_up(calibrated)
        self._features()


class NodeRig(Rig):
    """A rig whose node is removed when the driver is closed."""

    def __init__(self, device: Exchange, driver, backend, node: HidrawNode):
        super().__init__(device, driver, backend)
        close = driver.close

        def close_both() -> None:
            close()
            node.close()

        driver.close = close_both


def node_rig(kind: str, device: Exchange, arm: Arm, folder: Path) -> Rig:
    if kind == "hid node":
        backend = NodeFirmware(folder, arm)
        return NodeRig(device, open_device("hid:HVF-0001"), backend, backend.node)
    node = HidrawNode(SPACEMOUSE_DESCRIPTOR, 0x256F, 0xC635, "SpaceMouse Compact")
    rig = spacemouse_rig(device, open_hid("/dev/hidraw0"), node.post, "/dev/hidraw0")
    return NodeRig(device, rig.driver, rig.backend, node)
