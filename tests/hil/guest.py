"""Run in a virtual machine by `vm.py`: an unmodified hidapi, Linux's hidraw, and a device made through uhid."""

import sys
import time
from pathlib import Path

import numpy as np

from controllers.safety.faults import Fault
from experiments.hardware.link import measured_link
from sim.devices.driver import DriverFault
from sim.devices.hardware_list import list_devices, open_device
from tests.devices.firmware import Firmware
from tests.hil.uhid_device import UhidDevice


def fault_of(do) -> tuple[Fault, float]:
    try:
        do()
    except DriverFault as raised:
        return raised.fault, raised.value
    return Fault.NONE, 0.0


def check(what: str, found: object, expected: object) -> None:
    print(f"{'ok' if found == expected else 'FAILED'}: {what}: {found}", flush=True)
    if found != expected:
        sys.exit(1)


def main(library: str) -> None:
    firmware = Firmware(Path(library))
    device, reading = UhidDevice(firmware), np.zeros(9)
    deadline = time.monotonic() + 10.0
    while not list_devices() and time.monotonic() < deadline:
        time.sleep(0.1)
    check("the list", [(d.name, d.path, d.usable) for d in list_devices()], [("hid:HVF-0001", "/dev/hidraw0", True)])
    driver = open_device("hid:HVF-0001")
    check("identity", driver.identity[:4], ("Reference", "/dev/hidraw0", "HVF-0001", "1.0"))

    pose = np.array([0.3, -0.2, 0.5, 0.1, -0.4, 1.2])
    firmware.turn_to(pose)
    device.tick()
    check("a reading", driver.read(reading, 1.0), True)
    check("its angles", bool(np.abs(reading[3:] - pose).max() < 1e-3), True)
    device.tick()  # which `calibrate` waits for
    driver.calibrate(pose[:3] + 0.1, pose[3:])
    device.tick()
    driver.read(reading, 1.0)
    check("the calibration is kept", bool(np.abs(reading[3:6] - pose[:3] - 0.1).max() < 1e-3), True)

    torque = np.array([0.1, -0.2, 0.3])
    driver.write(torque, True)
    time.sleep(0.05)
    check("a torque arrives", bool(np.abs(firmware.joint_torque - torque).max() < 20e-6), True)
    driver.write(torque, False)
    time.sleep(0.05)

    run_realtime = device.run_realtime(4.0, 4e-3)
    link = measured_link(driver, 3.0)
    run_realtime.join()
    print("link:", *link.lines(), sep="\n  ", flush=True)
    check("readings are lost", link.lost, 0)
    check("readings are refused", link.refused, 0)
    check("readings come", link.readings > 200, True)
    check("a round trip takes time", link.round_trip > 0.0, True)
    while driver.read(reading, 0.0):
        pass

    valid_report = firmware.tick()
    for size in (40, 63, 70):
        device.send((valid_report + bytes(6))[:size])
        readings: list[bool] = []
        fault = fault_of(lambda readings=readings: readings.append(driver.read(reading, 0.5)))
        # Linux passes a report of another size on, or keeps back one that is short, or cuts one that is long.
        is_truncated = size > len(valid_report) and readings == [True]
        is_fault = fault == (
            Fault.REPORT_MALFORMED,
            float(min(size, len(valid_report) + 1)),
        )  # capped by the size asked for
        outcome = "a fault" if is_fault else "cut to 64 by the kernel" if is_truncated else "kept back by the kernel"
        print(f"    {outcome}", flush=True)
        check(f"{size} bytes are no other reading", is_fault or is_truncated or readings == [False], True)
    for _ in range(3):
        device.send(valid_report[:20] + bytes([valid_report[20] ^ 1]) + valid_report[21:])
    time.sleep(0.05)
    check("three wrong bits", fault_of(lambda: driver.read(reading, 1.0)), (Fault.CHECKSUM_WRONG, 3))
    begin = time.monotonic()
    check("silence is no reading", driver.read(reading, 0.05), False)
    check("and takes its time", time.monotonic() - begin >= 0.049, True)

    device.unplug()
    time.sleep(0.2)
    check("unplugged, reading", fault_of(lambda: driver.read(reading, 0.1))[0], Fault.UNPLUGGED)
    check("unplugged, writing", fault_of(lambda: driver.write(torque, True))[0], Fault.UNPLUGGED)
    driver.let_go()
    driver.close()
    print("hil-vm: passed", flush=True)


main(sys.argv[1])
