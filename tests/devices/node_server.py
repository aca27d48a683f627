"""A /dev/hidraw0 of umockdev for processes with libumockdev-preload: run by the system's Python, which has gi.

The node is a pty, so that poll() works; ioctl, read and write come here, so that packets keep their boundaries and an
unplugged device answers as the kernel does. Lines of JSON on the socket whose file descriptor is the only argument:

    {"packet": hex} {"feature": [number, hex]} {"gone": true}    from the test, each answered by {"done": true}
    {"directory": path} {"written": hex}                         to it
"""

import errno
import json
import os
import socket
import sys
import threading
import tty
from collections import deque

import gi

gi.require_version("UMockdev", "1.0")
from gi.repository import GLib, UMockdev  # noqa: E402

DESCRIPTOR_SIZE, DESCRIPTOR, RAW_INFO = 0x80044801, 0x90044802, 0x80084803  # <linux/hidraw.h>
SET_FEATURE, GET_FEATURE = 0x06, 0x07


class Node(UMockdev.IoctlBase):
    """Stands in for the kernel's hidraw towards a process that has the node open."""

    def __init__(self, line, descriptor: bytes, slave: int):
        super().__init__()
        self.line, self.descriptor, self.slave = line, descriptor, slave
        self.packets: deque[bytes] = deque()
        self.features: dict[int, bytes] = {}
        self.gone = False

    def send(self, **message) -> None:
        self.line.sendall(json.dumps(message).encode() + b"\n")

    def do_handle_ioctl(self, client) -> bool:
        request = client.get_request()
        number, size = request & 0xFF, request >> 16 & 0x3FFF
        if self.gone:
            client.complete(-1, errno.ENODEV)
        elif request == DESCRIPTOR_SIZE:
            client.get_arg().resolve(0, 4).update(0, len(self.descriptor).to_bytes(4, "little"))
            client.complete(0, 0)
        elif request == DESCRIPTOR:
            client.get_arg().resolve(0, size).update(4, self.descriptor)
            client.complete(0, 0)
        elif number == GET_FEATURE:
            buffer = client.get_arg().resolve(0, size)
            report = self.features.get(buffer.retrieve()[0], b"")[:size]
            buffer.update(0, report)
            client.complete(len(report) if report else -1, 0 if report else errno.EPIPE)
        elif number == SET_FEATURE:
            self.send(written=bytes(client.get_arg().resolve(0, size).retrieve()).hex())
            client.complete(size, 0)
        else:
            client.complete(-1, errno.ENOTTY)
        return True

    def do_handle_read(self, client) -> bool:
        if self.gone:
            client.complete(-1, errno.EIO)
        elif not self.packets:
            client.complete(-1, errno.EAGAIN)
        else:
            os.read(self.slave, 1)  # the byte that made poll() return
            buffer = client.get_arg()
            packet = self.packets.popleft()[: len(buffer.retrieve())]
            buffer.update(0, packet)
            client.complete(len(packet), 0)
        return True

    def do_handle_write(self, client) -> bool:
        if self.gone:
            client.complete(-1, errno.ENODEV)
        else:
            packet = bytes(client.get_arg().retrieve())
            self.send(written=packet.hex())
            client.complete(len(packet), 0)
        return True


def description(settings: dict) -> str:
    vendor, product = settings["vendor"], settings["product"]
    number, name, serial = f"0003:{vendor:08X}:{product:08X}", settings["name"], settings["serial"]
    uevent = f"HID_ID={number}\\nHID_NAME={name}\\nHID_PHYS=usb-1/input0\\nHID_UNIQ={serial}\\n"
    hid = f"0003:{vendor:04X}:{product:04X}.0001"
    return f"""P: /devices/usb1/1-1
E: SUBSYSTEM=usb
E: DEVTYPE=usb_device
A: idVendor={vendor:04x}
A: idProduct={product:04x}
A: product={name}
A: manufacturer=Test
A: serial={serial}
A: bcdDevice=0100

P: /devices/usb1/1-1/1-1:1.0
E: SUBSYSTEM=usb
E: DEVTYPE=usb_interface
A: bInterfaceNumber=00

P: /devices/usb1/1-1/1-1:1.0/{hid}
E: SUBSYSTEM=hid
E: HID_ID={number}
E: HID_NAME={name}
E: HID_UNIQ={serial}
A: uevent={uevent}
H: report_descriptor={settings["descriptor"].upper()}

P: /devices/usb1/1-1/1-1:1.0/{hid}/hidraw/hidraw0
N: hidraw0
E: SUBSYSTEM=hidraw
E: DEVNAME=/dev/hidraw0
A: dev=241:0
L: device=../../../{hid}
"""


def main() -> None:
    line = socket.socket(fileno=int(sys.argv[1]))
    lines = line.makefile("r")
    settings = json.loads(lines.readline())
    testbed = UMockdev.Testbed.new()
    testbed.add_from_string(description(settings))
    directory, mark = testbed.get_root_dir(), testbed.get_dev_fd("/dev/hidraw0")
    slave = os.open(os.readlink(f"{directory}/dev/hidraw0"), os.O_RDWR | os.O_NOCTTY)
    tty.setraw(slave)
    node = Node(line, bytes.fromhex(settings["descriptor"]), slave)
    testbed.attach_ioctl("/dev/hidraw0", node)
    loop = GLib.MainLoop()

    def handle_message(message: dict) -> None:
        if "packet" in message:
            node.packets.append(bytes.fromhex(message["packet"]))
            os.write(mark, b".")
        elif "feature" in message:
            node.features[message["feature"][0]] = bytes.fromhex(message["feature"][1])
        else:
            node.gone = True
            os.close(mark)  # a waiting poll() sees a hang-up, as on unplug
        node.send(done=True)

    def serve() -> None:
        try:
            for message in map(json.loads, lines):
                handle_message(message)
        except ConnectionError:
            pass  # the test has ended
        finally:
            GLib.idle_add(loop.quit)  # by the loop itself, which may not have begun yet

    node.send(directory=directory)
    threading.Thread(target=serve, daemon=True).start()
    loop.run()


main()
