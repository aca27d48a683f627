"""Defaults of a run in its resolved configuration."""

from pathlib import Path

import pytest

from experiments.cli import main, parse_command


@pytest.mark.usefixtures("without_page")
def test_default_pushes_are_in_the_resolved_configuration(tmp_path: Path) -> None:
    """Default pushes are written out, so that a run of the file repeats them."""
    from experiments.config.paths import load_config
    from experiments.setups.parts.defaults import resolved

    out = tmp_path / "pushed"
    assert main(["run", "--figure", "none", "--user", "push", "--lap", "0.5", "--seconds", "1", "--out", str(out)]) == 0
    config = load_config(out / "config.json")
    assert config.user.pushes
    assert resolved(config) == config
    assert parse_command(["run", "--config", str(out / "config.json")])
