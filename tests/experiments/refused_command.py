"""A command of `hvf` that has to be refused."""

import pytest

from experiments.cli import main


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on stderr of a command that ends with exit code 2."""
    code = main(arguments)
    stderr = capsys.readouterr().err
    assert code == 2
    assert stderr.startswith("hvf: ")
    assert stderr.count("\n") == 1
    assert "Traceback" not in stderr
    return stderr
