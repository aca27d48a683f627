"""What every device promises, whatever it is made of."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from controllers.state import HandState
from experiments.config.part import to_dict
from experiments.config.words import run_config
from experiments.setups.wiring import wire
from models.humanoid.skeleton import rest_pose
from sim.devices.base import Device, DeviceError
from sim.devices.replay import ReplayDevice
from sim.devices.simulated import SimulatedPhantom
from sim.loop.loop import Loop, groups, record_into
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording
from sim.users.arm import Arm
from sim.world.world import World

TICKS = 40
MakeDevice = Callable[[], Device]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "run.h5"
    config = run_config(clips=("cheer",), seconds=TICKS * 1e-3)
    session = wire(config)
    with Recorder(path, to_dict(config), config.seed, groups(session.servo), session.static()) as recorder:
        Loop(session.servo, session.world, record_into(recorder, session.servo, session.world)).run(config.seconds)
    return path


@pytest.fixture(params=["simulated", "replay"])
def make_device(request: pytest.FixtureRequest, recorded: Path) -> Iterator[MakeDevice]:
    if request.param == "simulated":

        def simulated() -> Device:
            world = World()
            world.reset(np.array([0.02, 0.01, 0.0]), rest_pose())
            return SimulatedPhantom(world, Arm(), cutoff=150.0)

        yield simulated
    else:
        with Recording(recorded) as recording:
            yield lambda: ReplayDevice(recording)


def test_time_starts_at_zero_and_advances_by_the_period(make_device: MakeDevice) -> None:
    with make_device() as device:
        times: list[float] = []
        for _ in range(5):
            times.append(device.read().t)
            device.write(np.zeros(3))
    np.testing.assert_allclose(times, np.arange(5) * device.period, atol=1e-12)


def test_a_state_is_finite_with_a_unit_quaternion(make_device: MakeDevice) -> None:
    with make_device() as device:
        for _ in range(TICKS):
            state = device.read()
            assert np.isfinite(state.vector()).all()
            assert np.linalg.norm(state.q) == pytest.approx(1.0, abs=1e-9)
            device.write(np.zeros(3))


def test_reading_again_before_a_write_tells_the_same(make_device: MakeDevice) -> None:
    with make_device() as device:
        device.read()
        device.write(np.array([0.5, 0.0, 0.0]))
        first, second = device.read(), device.read()
    np.testing.assert_array_equal(first.vector(), second.vector())


def test_velocity_is_the_rate_of_position(make_device: MakeDevice) -> None:
    """The filter lags by a few milliseconds; over 30 ms of motion it has to agree with the distance covered."""
    with make_device() as device:
        states: list[HandState] = []
        for _ in range(TICKS):
            states.append(device.read())
            device.write(np.array([0.3, 0.0, 0.2]))
    covered = states[-1].p - states[0].p
    integrated = np.sum([state.v for state in states], axis=0) * device.period
    np.testing.assert_allclose(integrated, covered, atol=0.15 * np.linalg.norm(covered) + 1e-4)


@pytest.mark.parametrize("force", [[0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, np.inf, 0.0]])
def test_a_force_that_is_not_three_finite_numbers_is_refused(make_device: MakeDevice, force: list[float]) -> None:
    with make_device() as device:
        device.read()
        with pytest.raises(DeviceError, match="three finite numbers"):
            device.write(np.array(force))


def test_a_closed_device_neither_reads_nor_writes_and_closes_twice(make_device: MakeDevice) -> None:
    device = make_device()
    device.close()
    device.close()
    with pytest.raises(DeviceError, match="closed"):
        device.read()
    with pytest.raises(DeviceError, match="closed"):
        device.write(np.zeros(3))


def test_a_run_is_the_same_again(make_device: MakeDevice) -> None:
    def trace() -> np.ndarray:
        with make_device() as device:
            rows = []
            for _ in range(TICKS):
                rows.append(device.read().vector())
                device.write(np.array([0.2, -0.1, 0.1]))
            return np.array(rows)

    np.testing.assert_array_equal(trace(), trace())


def test_a_replay_ends_with_its_recording(recorded: Path) -> None:
    with Recording(recorded) as recording, ReplayDevice(recording) as device:
        for _ in range(TICKS):
            device.read()
            device.write(np.zeros(3))
        with pytest.raises(DeviceError, match=f"ends after {TICKS} ticks"):
            device.read()
