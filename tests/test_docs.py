"""Documentation works as shown: Python runs, commands parse, links exist, the site builds."""

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import matplotlib.pyplot as plt
import pytest

from experiments.cli import parse_command
from experiments.commands import NAMES
from experiments.config.options import config_of_options
from experiments.trials.study import Study
from experiments.tuning.tune_config import read_tuning

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md")), *sorted((ROOT / "models").rglob("README.md"))]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXPECTED_OUTPUT = {  # output that a page promises for its blocks
    "README.md": ["{'field.k_r': 400}", "so is any switching between them"],  # on the cases of the law
    "docs/tutorials/your-own-study.md": ["48 trials"],
    "docs/tutorials/your-own-law.md": [
        "k = 100 N/m: pushed down by 6.2 mm",
        "k = 400 N/m: pushed down by 3.5 mm",
        "k = 400 N/m: certified",
        "k = 20000 N/m: refuted",
        "k = 10262 N/m: 0.26 mm; 6 refused",
    ],
}


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, *languages: str) -> list[str]:
    found = FENCE.findall(page.read_text(encoding="utf-8"))
    return [block for language, block in found if language.strip() in languages]


def commands(page: Path) -> list[str]:
    """Lines of blocks and code in sentences that begin with hvf, make or python -m."""
    shown = [line for block in blocks(page, "", "sh") for line in block.splitlines()]
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    inline = [" ".join(code.split()) for code in re.findall(r"(?<!`)`([^`]+)`(?!`)", prose)]
    return [line for line in shown + inline if re.match(r"(hvf|make|python -m) \S", line) and "…" not in line]


def pages_with(*languages: str) -> list[Path]:
    return [page for page in PAGES if blocks(page, *languages)]


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with("python"), ids=name)
def test_python_blocks_of_page_run_in_order(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "models/mocap/clips/walk.bvh", "mine.bvh")  # stands for a reader's own file
    typed = ModuleType("typed")
    monkeypatch.setitem(sys.modules, "typed", typed)  # where kernels of a page are looked up
    for block in blocks(page, "python"):
        exec(compile(block, f"<{name(page)}>", "exec"), typed.__dict__)  # not a file, as in an interactive session
    plt.close("all")
    stdout = capsys.readouterr().out
    for sentence in EXPECTED_OUTPUT.get(name(page), []):
        assert sentence in stdout
    assert " fell at " not in stdout
    named = "".join(blocks(page, "python")) + "mine.bvh"
    left = [path.name for path in tmp_path.iterdir() if path.suffix != ".png"]
    assert not [name for name in left if name not in named]  # a run in memory leaves nothing


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=name)
def test_commands_on_page_parse(page: Path) -> None:
    for line in commands(page):
        program, *arguments = shlex.split(line, comments=True)
        if program == "hvf":
            _parses(arguments, line)
        elif program == "make":
            assert re.search(rf"^{re.escape(arguments[0])}:", MAKEFILE, re.MULTILINE), line
        elif arguments[1].split(".")[0] in ("experiments", "models"):
            module = ROOT / arguments[1].replace(".", "/")
            assert module.with_suffix(".py").exists() or (module / "__main__.py").exists(), line


def _parses(arguments: list[str], line: str) -> None:
    if {"--help", "--version", "COMMAND"} & set(arguments) or arguments[0].startswith("--"):
        return
    if len(arguments) == 1 and arguments[0] in NAMES:
        return  # the command's name, without what it needs
    command = parse_command(arguments)
    assert callable(command), line
    options = getattr(command, "options", None)
    if options is not None and options.config is None:  # files of earlier runs do not exist here
        assert config_of_options(options), line


TOML = {  # how TOML shown on a page is read
    "docs/how-to/rigs.md": lambda path: tomllib.loads(path.read_text(encoding="utf-8")),  # an excerpt, as it says
    "docs/how-to/tuning.md": read_tuning,
    "docs/how-to/user-studies.md": Study.load,
    "docs/tutorials/your-own-study.md": Study.load,
}


@pytest.mark.parametrize("page", pages_with("toml"), ids=name)
def test_toml_blocks_of_page_load(page: Path, tmp_path: Path) -> None:
    for block in blocks(page, "toml"):
        file = tmp_path / "shown.toml"
        file.write_text(block, encoding="utf-8")
        read = TOML[name(page)](file)
        if isinstance(read, Study):
            assert read.trials


def test_command_reference_lists_every_command() -> None:
    listed = re.findall(r"^\| `hvf (\w+)`", (DOCS / "reference" / "command-line.md").read_text(encoding="utf-8"), re.M)
    assert sorted(listed) == sorted(NAMES)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_and_pictures_of_page_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", FENCE.sub("", page.read_text(encoding="utf-8"))):
        if not target.startswith("http"):
            moved = [name(other) for other in PAGES if other.name == Path(target).name]
            assert (page.parent / target).exists(), f"{target} is not there; pages of that name: {moved}"


@pytest.mark.parametrize("model", sorted((ROOT / "models").rglob("*.xml")), ids=lambda path: path.stem)
def test_page_of_model_shows_it_and_the_source_of_its_numbers(model: Path) -> None:
    page = (model.parent / "README.md").read_text(encoding="utf-8")
    assert re.search(r"^!\[.*\]\(\w+\.png\)", page, re.MULTILINE)
    assert "| source |" in page


SOURCE = re.compile(r"`((?:controllers|experiments|models|sim|tests|examples|docs)/[\w/.-]+)(?::(\w+))?`")


def test_source_paths_and_names_in_pages_exist() -> None:
    for page in PAGES:
        for path, defined in SOURCE.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
            assert (ROOT / path).exists(), f"{name(page)}: {path}"
            if defined:
                source = (ROOT / path).read_text(encoding="utf-8")
                assert re.search(rf"^(?:(?:def|class) )?{defined}\b", source, re.MULTILINE), (
                    f"{name(page)}: {path}:{defined}"
                )


@pytest.mark.slow
def test_site_builds_without_warnings(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "--builder", "html", "--fail-on-warning", "--keep-going", "--quiet",
         str(DOCS), str(tmp_path / "site")],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    page = (tmp_path / "site" / "explanation" / "paper.html").read_text(encoding="utf-8")
    assert "<math" in page  # drawn by the browser, without a script from elsewhere
    assert not re.findall(r"<(?:script|link)[^>]+(?:src|href)=\"https?://", page)


def test_licence_file_matches_pyproject() -> None:
    assert "Apache License" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert 'license = "Apache-2.0"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("row", ["rubber-from", "bunny-attraction", "k_s", "damping b is added", "convolution"])
def test_paper_page_lists_deviation_from_paper(row):
    assert row in (DOCS / "explanation" / "paper.md").read_text(encoding="utf-8")
