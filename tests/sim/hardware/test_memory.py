"""The servo loop allocates nothing on the heap: neither in compiled code nor in Python nor in C."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from controllers.safety.arming import ARM, NO_REQUEST, State
from controllers.safety.gate import Gate
from experiments.config import maps, modes
from experiments.config.run_config import RunConfig
from experiments.hardware.parts import served, session_of, start_of
from experiments.setups.parts.defaults import resolved
from geometry.arrays import Array
from models.world.scene import SceneConfig
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.gated_servo import GatedServo, Ticker
from tests.devices.firmware import ROOT, compile_c
from tests.sim.hardware.emulation import UNRAMPED_GATE

HERE, DEVICES = Path(__file__).parent, ROOT / "tests" / "devices"
LIBRARY_SOURCES = {
    "HID": (DEVICES / "mock_hidapi.c", ROOT / "firmware" / "hvf_hid.c"),
    "DHD": (DEVICES / "mock_dhd.c",),
    "HDAPI": (DEVICES / "mock_hd.c",),
}
RESTRICTED = modes.Follow(
    walls=modes.JointWalls(), governor=modes.SpeedGovernor(),
    orientation=modes.OrientationMoment(orientation_stiffness=0.05),
)  # fmt: skip
RUNS = {
    "bunny": RunConfig(mode=modes.Bunny()),
    "rivers": RunConfig(mode=modes.Rivers()),
    "stretch": RunConfig(mode=modes.Stretch()),
    "FOLLOW with all options": RunConfig(mode=RESTRICTED, map=maps.Cylindrical(expressive=True)),
    "joint walls of a composite": RunConfig(mode=modes.Follow(walls=modes.JointWalls()), map=maps.Composite()),
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="calls of the heap are counted by the loader of glibc")
def test_servo_loop_makes_no_heap_calls_in_2000_ticks_with_any_device(tmp_path: Path) -> None:
    """Counts calls of Python, numba, NumPy, MuJoCo and libc, in the servo and in a vendor's thread."""
    library = compile_c(tmp_path, HERE / "heap_calls.c")
    environment = os.environ | {"LD_PRELOAD": str(library), "PYTHONMALLOC": "malloc"}
    devices = ["packets", *(f"{name}={compile_c(tmp_path, *files)}" for name, files in LIBRARY_SOURCES.items())]
    command = [sys.executable, "-m", "tests.sim.hardware.counted_servo", *devices]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    rows = [line.split() for line in result.stdout.splitlines()]
    assert [name for name, *_ in rows] == ["packets", *LIBRARY_SOURCES]
    for name, state, calls, calls_of_a_thousand_numbers in rows:
        assert state == State.ACTIVE.name, result.stderr
        assert int(calls) == 0, name
        assert int(calls_of_a_thousand_numbers) > 1000  # the counter works


class UncountedDevice(EmulatedPhantom):
    """A device that is simulated between two ticks, where nothing is counted."""

    pending_command = np.zeros(3), False

    def read(self, reading: Array, timeout: float) -> bool:
        return True

    def write(self, torque: Array, enable: bool) -> None:
        self.pending_command = torque, enable

    def pass_tick(self, reading: Array) -> None:
        super().write(*self.pending_command)
        super().read(reading, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_fields_of_hardware_runs_allocate_nothing(name: str) -> None:
    config = resolved(RUNS[name])
    session, period = session_of(served(config)), config.clock.servo_period
    driver = UncountedDevice(SceneConfig(servo_period=period), start_of(session), holds=0.0)
    gate = Gate(period, permitted=True, dead_man=False, **UNRAMPED_GATE)
    ticker, allocations = Ticker(GatedServo(session.servo, session.world, driver, gate, np.zeros(3))), 0
    _nrt_python.memsys_enable_stats()
    try:
        for k in range(1500):
            driver.pass_tick(session.servo.device.reading)
            before = rtsys.get_allocation_stats().alloc
            ticker.tick(float(k), ARM if k == 0 else NO_REQUEST)
            allocations += rtsys.get_allocation_stats().alloc - before
    finally:
        _nrt_python.memsys_disable_stats()
    assert ticker.state is State.ACTIVE
    assert allocations == 0
