"""Options of the robot arm: its configuration comes from a file, from what is given, or from the defaults."""

import math
from dataclasses import fields
from pathlib import Path

import pytest

from controllers.errors import ParameterError
from experiments.cli import main, parsed
from experiments.config.arm_options import ArmOptions, arm_config_of_options
from experiments.config.part import to_json
from experiments.config.run_config import ArmConfig, Clock

MINE = ArmConfig(user="relaxed", seconds=1.5, stiffness=0.0, tube=math.inf, clock=Clock(servo_period=2e-3))


def resolved(*words: str) -> ArmConfig:
    return arm_config_of_options(parsed(["arm", *words]).options)


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "config.json"
    path.write_text(to_json(MINE), encoding="utf-8")
    return str(path)


def test_every_number_of_the_configuration_is_an_option() -> None:
    names = {each.name for cls in (ArmConfig, Clock) for each in fields(cls)} - {"clock"}  # pyright: ignore
    assert {each.name for each in fields(ArmOptions)} == names | {"config"}
    assert resolved() == ArmConfig()
    assert resolved("--stiffness", "0", "--user", "relaxed", "--physics-step", "1e-3") == ArmConfig(
        stiffness=0.0, user="relaxed", clock=Clock(physics_step=1e-3)
    )


def test_what_is_given_changes_the_configuration_of_a_file(file: str) -> None:
    assert resolved("--config", file) == MINE
    changed = resolved("--config", file, "--seed", "0", "--physics-step", "1e-3")
    assert changed == ArmConfig(
        user="relaxed", seconds=1.5, stiffness=0.0, tube=math.inf, seed=0,
        clock=Clock(servo_period=2e-3, physics_step=1e-3),
    )  # fmt: skip


def test_a_file_that_holds_no_configuration_of_the_arm_is_refused(
    file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for text, said in (("{", "is not JSON"), ('{"mode": {}}', "mode is not known; expected some of user, seconds, ")):
        Path(file).write_text(text, encoding="utf-8")
        assert main(["arm", "--config", file, "--out", str(tmp_path / "arm")]) == 2
        assert capsys.readouterr().err.startswith(f"hvf: {file}: {said}")
    assert main(["arm", "--config", str(tmp_path / "none.json")]) == 2
    assert "none.json: cannot be read (No such file or directory)" in capsys.readouterr().err
    with pytest.raises(ParameterError, match="radius is 0; expected more than 0 m"):
        resolved("--radius", "0")
