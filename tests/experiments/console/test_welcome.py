"""What `hvf` without arguments prints."""

from experiments.cli import WELCOME, main, parse_command


def test_welcome_text_names_only_existing_commands(capsys) -> None:
    assert main([]) == 0
    stdout = capsys.readouterr().out
    assert stdout == WELCOME + "\n"
    for line in stdout.splitlines():
        if line.startswith("  hvf "):
            assert callable(parse_command(line.strip().split("  ")[0].split()[1:])), line
