"""``hvf hardware calibrate``: zero offsets of the encoders, from readings of a stylus held at a known pose."""

import time
from pathlib import Path

import numpy as np

from experiments.console.output import say
from experiments.files.device_files import calibrated_json, linkage_from, read_device_file, save_device
from experiments.hardware.run_options import EMULATED, check_emulate
from geometry.arrays import Array
from models.humanoid.skeleton import rest_pose
from models.phantom.kinematics import ENCODER_STEP, forward_kinematics, vector_to_hand_frame, within_limits
from models.world.scene import SceneConfig
from sim.devices.driver import Driver
from sim.devices.exchange import READING_SIZE, READING_THETA
from sim.devices.hardware_list import open_device
from sim.errors import SimError
from sim.hardware.emulated import EmulatedPhantom
from sim.world.linkage import Linkage

MAX_REST_MOTION = 5e-3
"""Largest motion of a joint while it is read [rad], about a millimetre at the tip: allows tremor but no motion."""
_PERIOD = 1e-3  # s


def calibrate(
    name: str, pose: tuple[float, float, float], seconds: float, out: Path, overwrite: bool, emulate: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Read a device at a known pose with its motors off, print its zero offsets, and write them.

    The arguments are the options of ``hvf hardware calibrate``.

    Raises
    ------
    ParameterError, SimError
        If the pose is beyond the joint limits, there is no such device, it moves or gives no readings, or the file
        already has a calibration.
    """
    if not within_limits(pose):
        raise SimError(
            f"--pose {' '.join(f'{angle:g}' for angle in pose)} is beyond the joints' stops; expected three "
            "angles [rad] at which a Phantom can stand, such as 0 0 0"
        )
    check_emulate(name, emulate)
    base = read_device_file(out) if out.exists() else {}
    if "offset" in base and not overwrite:
        raise SimError(f"{out}: already has an encoder offset; choose another --out, or --overwrite that offset")
    emulated_linkage = linkage_from(read_device_file(emulate) if emulate else {})
    driver = Fixture(pose, emulated_linkage) if name == EMULATED else open_device(name)
    try:
        readings = still_readings(driver, seconds)
    finally:
        driver.close()
    offset = readings.mean(axis=0) - np.array(pose)
    # Half an encoder count, or half the range of the readings if that is larger.
    margin = 0.5 * np.maximum(np.array(ENCODER_STEP), np.ptp(readings, axis=0))
    content = calibrated_json(offset.tolist(), margin.tolist(), driver.identity, base)
    save_device(content, out)
    lines = [f"offset{i + 1}  {offset[i]: .5f} ± {margin[i]:.5f} rad" for i in range(3)]
    device = f"{driver.identity.name} {driver.identity.serial}".rstrip()
    say(content, as_json, [*lines, f"{device}: {len(readings)} readings; in {out}."])


def still_readings(driver: Driver, seconds: float) -> Array:
    """Joint angles of a device at rest, read for `seconds` [s], shape (n, 3) [rad].

    Raises
    ------
    SimError
        If no readings arrive, or the joints turn.
    """
    reading, found = np.zeros(READING_SIZE), list[Array]()
    driver.write(np.zeros(3), False)  # before the clock starts, as an emulated device may first have to be compiled
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        driver.write(np.zeros(3), False)
        if driver.read(reading, 2.0 * _PERIOD):
            found.append(reading[READING_THETA : READING_THETA + 3].copy())
        time.sleep(0.5 * _PERIOD)
    if not found:
        raise SimError(f"{driver.identity.name} gave no reading in {seconds:g} s; expected one a millisecond")
    readings = np.array(found)
    moved = float(np.ptp(readings, axis=0).max())
    if not moved <= MAX_REST_MOTION:
        raise SimError(
            f"a joint turned by {moved:.2g} rad while it was read; expected {MAX_REST_MOTION:g} or less: hold the "
            "stylus still"
        )
    return readings


class Fixture(EmulatedPhantom):
    """The emulated device in a rigid fixture at a pose; in a hand, it would sag by a fraction of an encoder count.

    Parameters
    ----------
    pose : three floats
        Angles of the joints [rad].
    linkage : Linkage
        Parameters of the device.
    """

    def __init__(self, pose: tuple[float, float, float], linkage: Linkage):
        self._tip_position = np.array(vector_to_hand_frame(forward_kinematics(pose)))
        super().__init__(SceneConfig(servo_period=_PERIOD), self._tip_position, linkage, holds=0.0)

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver`; the device stays in its pose."""
        super().write(torque, enable)
        self.world.reset(self._tip_position, rest_pose())
