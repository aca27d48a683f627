"""Tests through /dev/hidraw0 and an unmodified hidapi, in a process with umockdev preloaded."""

import os
import subprocess
import sys

import pytest

from tests.devices.firmware import COMPILER, ROOT
from tests.devices.hidraw_node import PRELOAD, umockdev_missing

INNER = "HVF_INNER"


def run_with_umockdev(*arguments: str, seconds: float = 240.0) -> str:
    """Run pytest in a process with umockdev and return its output; the test is skipped where there is none."""
    if os.environ.get(INNER):
        pytest.skip("this is the process")
    if umockdev_missing() or COMPILER is None:
        pytest.skip(umockdev_missing() or "no C compiler")
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-o", "addopts=", "-p", "no:cacheprovider", *arguments],
        cwd=ROOT, env=os.environ | {"LD_PRELOAD": PRELOAD, INNER: "1"}, capture_output=True, text=True, timeout=seconds,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout[-6000:] + result.stderr[-2000:]
    return result.stdout


@pytest.mark.slow
def test_contract_driver_device_list_and_doctor_hold_for_hid_and_spacemouse_through_nodes() -> None:
    files = ("tests/contract/test_device_contract.py", "tests/devices/inside_umockdev.py")
    chosen = "(test_device_contract and node) or (inside_umockdev and not command_line)"
    assert "33 passed" in run_with_umockdev(*files, "-k", chosen)


@pytest.mark.processes
def test_device_behind_a_node_is_certified_and_run_from_the_command_line() -> None:
    assert "1 passed" in run_with_umockdev("tests/devices/inside_umockdev.py", "-k", "command_line", seconds=600.0)
