"""MuJoCo's warnings are counted, and leave nothing behind in the user's folder."""

from pathlib import Path

import mujoco
import pytest

from sim.world.world import World


def test_a_warning_is_counted_and_neither_printed_nor_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    world = World(kind="none")
    world.data.qvel[:] = 1e30
    mujoco.mj_checkVel(world.model, world.data)
    assert world.warnings() == {"badqvel": 1}
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
