"""A HID device made through /dev/uhid, with the reference firmware behind it (linux/uhid.h)."""

import os
import struct
import threading
import time

from tests.devices.firmware import Firmware

DESTROY, OUTPUT, GET_REPORT, GET_REPLY, CREATE2, INPUT2, SET_REPORT, SET_REPLY = 1, 6, 9, 10, 11, 12, 13, 14
_EVENT_SIZE = 4380
_USB = 3


class UhidDevice:
    """The firmware as a device of the kernel."""

    def __init__(self, firmware: Firmware, name: str = "Reference", serial: str = "HVF-0001"):
        self.firmware, self.fd, self._lock = firmware, os.open("/dev/uhid", os.O_RDWR), threading.Lock()
        self._clock_zero: float | None = None  # when its clock was zero, while it runs in real time
        descriptor = firmware.descriptor()
        identity = (name.encode(), b"uhid", serial.encode(), len(descriptor))
        head = struct.pack("<I128s64s64sHHIIII", CREATE2, *identity, _USB, 0x16C0, 0x0486, 1, 0)
        os.write(self.fd, head + descriptor.ljust(4096, b"\0"))
        threading.Thread(target=self._listen, daemon=True).start()

    def send(self, report: bytes) -> None:
        """An input report, of whatever size."""
        os.write(self.fd, struct.pack("<IH", INPUT2, len(report)) + report)

    def tick(self, period: float = 1e-3) -> None:
        """Advance by a period and send the report."""
        with self._lock:
            report = self.firmware.tick(period)
        self.send(report)

    def run_realtime(self, seconds: float, period: float = 1e-3) -> threading.Thread:
        """Tick for a while in a thread, in real time, which also stamps what arrives between two ticks."""

        def run() -> None:
            begin, k = time.monotonic(), 0
            self._clock_zero = begin - 1e-6 * self.firmware.sensors.time_us
            while k * period < seconds:
                k += 1
                time.sleep(max(0.0, begin + k * period - time.monotonic()))
                with self._lock:
                    self._update_clock()
                self.tick(0.0)
            self._clock_zero = None

        thread = threading.Thread(target=run)
        thread.start()
        return thread

    def _update_clock(self) -> None:
        if self._clock_zero is not None:
            self.firmware.sensors.time_us = round(1e6 * (time.monotonic() - self._clock_zero))

    def unplug(self) -> None:
        """Remove the device."""
        os.write(self.fd, struct.pack("<I", DESTROY))

    def _listen(self) -> None:
        while True:
            event = os.read(self.fd, _EVENT_SIZE)
            (kind,) = struct.unpack_from("<I", event)
            if kind == OUTPUT:
                (size,) = struct.unpack_from("<H", event, 4 + 4096)
                with self._lock:
                    self._update_clock()
                    self.firmware.take(event[4 : 4 + size])
            elif kind == GET_REPORT:
                number, report = struct.unpack_from("<IB", event, 4)
                feature = self.firmware.feature(report)
                os.write(self.fd, struct.pack("<IIHH", GET_REPLY, number, 0 if feature else 5, len(feature)) + feature)
            elif kind == SET_REPORT:
                number, _, _, size = struct.unpack_from("<IBBH", event, 4)
                with self._lock:
                    taken = self.firmware.take(event[12 : 12 + size])
                os.write(self.fd, struct.pack("<IIH", SET_REPLY, number, 0 if taken else 5))
