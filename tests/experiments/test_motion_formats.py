"""Help, documentation and messages name the formats of motion files that are read and written, and no other."""

import re
from pathlib import Path

import pytest

import hvf
from experiments.cli import main
from experiments.live.panels.run_panel import UPLOAD_HINT
from models.mocap.readers.formats import READABLE, READABLE_NAMES, WRITABLE

ROOT = Path(__file__).resolve().parents[2]
SKELETONS = "ASF"  # a skeleton, which accompanies AMC
_OTHERS = ("FBX", "C3D", "TRC", "USD", "VRM", "HTR")
_FORMATS = re.compile(rf"\b({'|'.join((*_OTHERS, SKELETONS, *(kind.name for kind in (*READABLE, *WRITABLE))))})\b")


def text_of(page: str, start: str) -> str:
    """The paragraph or row of a page that contains the words `start`."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return next(block for block in re.split(r"\n\n|\n(?=\|)", text) if start in block)


def help_of(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    return capsys.readouterr().out


def named(text: str) -> set[str]:
    return set(_FORMATS.findall(text)) - {SKELETONS}


@pytest.mark.parametrize(
    "text",
    [
        READABLE_NAMES,
        str(hvf.load.__doc__),
        UPLOAD_HINT,
        text_of("docs/how-to/live.md", "*Upload*"),
        text_of("docs/reference/command-line.md", "`hvf convert`"),
        text_of("docs/tutorials/your-own-motion.md", "You need a"),
    ],
    ids=["messages", "hvf.load", "upload", "live.md", "command-line.md", "your-own-motion.md"],
)
def test_text_names_exactly_the_formats_that_are_read(text: str) -> None:
    assert named(text) == {kind.name for kind in READABLE}


def test_help_names_exactly_the_formats_that_are_read_and_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert named(help_of("prepare", capsys)) == {kind.name for kind in READABLE}
    convert = help_of("convert", capsys)
    assert named(convert) == {kind.name for kind in (*READABLE, *WRITABLE)}
    assert all(kind.suffix in convert for kind in WRITABLE)
