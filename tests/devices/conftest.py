"""Fixtures: a clock that tests set, and the reference firmware, compiled from C."""

from pathlib import Path

import pytest

from tests.devices.firmware import ROOT, Firmware, FirmwareHandle, compile_c
from tests.devices.hand_made import Clock


@pytest.fixture(scope="session")
def firmware_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_c(tmp_path_factory.mktemp("firmware"), ROOT / "firmware" / "hvf_hid.c")


@pytest.fixture
def firmware(firmware_library: Path) -> Firmware:
    return Firmware(firmware_library)


@pytest.fixture
def handle(firmware: Firmware) -> FirmwareHandle:
    return FirmwareHandle(firmware)


@pytest.fixture
def clock() -> Clock:
    return Clock()
