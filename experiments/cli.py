"""The ``hvf`` command: haptic vector fields from the command line."""

from experiments.console import startup  # before NumPy is imported

# isort: split

import contextlib
import errno
import io
import itertools
import os
import re
import signal
import sys
from collections.abc import Sequence
from dataclasses import fields
from functools import reduce
from importlib import import_module
from importlib.metadata import version
from operator import or_
from typing import Annotated, Any

import tyro

from controllers.errors import ParameterError
from experiments import commands
from experiments.config.keywords import option_message
from geometry.errors import HvfError

_DESCRIPTION = f"{__doc__} hvf --version prints the version."
_STYLE = (tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff, tyro.conf.DisallowNone)
_SHELLS = ("bash", "zsh", "fish")  # for which tyro writes completions without another package
WELCOME = """hvf: a hand on a force-feedback arm feels an animation as a river, follows it, bends it.

  hvf demo                            see it work: a run, and a page to open in a browser
  hvf live                            take the stylus with the mouse, in the browser
  hvf run --clips A.bvh B.amc         the same over your own motion capture
  hvf run --mode stretch-then-follow  bend a curve, and perform it
  hvf render runs/demo                film a run
  hvf certify runs/demo               certify its field: stability, passivity, energy
  hvf clips                           list the embedded clips

hvf --help lists all commands, hvf COMMAND --help the options of one."""
"""What ``hvf`` prints when it is called without arguments."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; bad input gives one line on stderr and exit code 2, a closed output pipe exit code 141."""
    try:
        try:
            return _run(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # The reader has closed the pipe, as `head` does: discard the rest, also what the interpreter flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _ignore_warning(warning: str) -> None:
    """Ignore a warning of MuJoCo, which keeps count of its warnings itself."""


def _run(arguments: Sequence[str] | None) -> int:
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words in ([], ["--version"]):
        print(WELCOME if not words else f"hvf {version('haptic-vector-fields')}")
        return 0
    command: Any = None
    try:
        command = parse_command(words)
        if signal.getsignal(signal.SIGINT) is startup.stop_early:
            startup.handle_interrupts()
        import mujoco  # imported late: help and error messages do not need it

        # MuJoCo would print a warning and write it to MUJOCO_LOG.TXT in the user's folder; a run's summary counts them.
        mujoco.set_mju_user_warning(_ignore_warning)
        return command()
    except BrokenPipeError:
        raise
    except HvfError as error:
        print(f"hvf: {option_message(error)}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"hvf: {_system_error_message(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"hvf: stopped; {_interruption_message(command)}", file=sys.stderr)
        return 130


def _system_error_message(error: OSError) -> str:
    """Message for an error of the operating system; an error of a full disk does not name its file."""
    if error.errno == errno.ENOSPC:
        return "the disk is full; expected room on it, or another --out"
    return f"{error.filename}: {error.strerror}; expected a path to read or write" if error.filename else str(error)


def _interruption_message(command: Any) -> str:
    """Message on what an interrupted command has left on disk, and how to continue."""
    from experiments.hardware.run_options import RunHardware  # imported late: they load MuJoCo and numba
    from experiments.results.folder import RECORDING

    if isinstance(command, command_class("run") | command_class("demo")) and (command.out / RECORDING).exists():
        return (
            f"what was recorded until then is in {command.out}: hvf report {command.out} writes its page, summary and "
            f"animations, hvf render {command.out} films it, "
            f"hvf run --config {command.out}/config.json --out NEW runs it again"
        )
    recorder = command.which if isinstance(command, command_class("hardware")) else command
    if isinstance(recorder, RunHardware) and (recorder.out / RECORDING).exists():
        return f"what was recorded until then is in {recorder.out}: hvf report {recorder.out} writes its page"
    if isinstance(command, command_class("trials") | command_class("tune")) and command.out.exists():
        return f"finished trials are kept in {command.out}; the same command resumes from there"
    return "no partial files are left"


def command_class(name: str) -> Any:
    """Class of a command, by name: that of ``hvf run`` is in `experiments.commands.run`."""
    return import_module(f"experiments.commands.{name}").Command


def command_union(names: Sequence[str]) -> Any:
    """Union type from which tyro parses one of these commands."""
    return reduce(or_, (Annotated[command_class(name), tyro.conf.subcommand(name)] for name in names))


def parse_command(words: Sequence[str]) -> Any:
    """The command that these words of the command line ask for.

    Raises
    ------
    ParameterError
        If they are wrong; tyro's boxed message is shortened to one line.
    """
    _refuse_empty(words)
    words = _join_axis_values(words)
    errors = io.StringIO()
    command = words[0] if words and words[0] in commands.NAMES else None
    # If a command is named, the options of the others are not imported.
    prog, rest, choice = ("hvf", words, command_union(commands.NAMES)) if command is None else (
        f"hvf {command}", words[1:], command_class(command)
    )  # fmt: skip
    try:
        with contextlib.redirect_stderr(errors):
            return tyro.cli(choice, prog=prog, args=rest, description=None if command else _DESCRIPTION, config=_STYLE)
    except SystemExit as ended:
        if ended.code in (0, None):
            raise
        # If a part of the configuration refused a value, its own message is clearer than tyro's.
        cause: BaseException | None = ended
        while cause is not None:
            if isinstance(cause, ParameterError):
                raise cause from None
            cause = cause.__cause__ or cause.__context__
        raise ParameterError(_shorten_message(errors.getvalue(), words)) from None


def _refuse_empty(words: Sequence[str]) -> None:
    """Refuse empty arguments: they come from unset variables of a script, and would mean the current folder."""
    for before, word in zip(["hvf", *words], words, strict=False):
        if not word.strip() or re.fullmatch(r"--[\w.-]+=", word):
            option = word.strip("= ") or before
            raise ParameterError(f"nothing is given after {option}; expected a value")
    for word, following in itertools.pairwise([*words, "--"]):
        if word == "--clips" and following.startswith("--"):  # tyro would take the default clips
            raise ParameterError("nothing is given after --clips; expected one or more names")
        if word in ("--tyro-print-completion", "--tyro-write-completion") and following not in _SHELLS:
            raise ParameterError(f"{word} is {following.strip('-')!r}; expected {', '.join(_SHELLS)}")


def _join_axis_values(words: Sequence[str]) -> list[str]:
    """Join ``--up -Y`` to one word: argparse would take an axis with a minus sign for another option."""
    joined: list[str] = []
    for word in words:
        if re.fullmatch("-[XYZ]", word) and joined and re.fullmatch(r"--[\w-]+", joined[-1]):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _shorten_message(message: str, words: Sequence[str]) -> str:
    """Text of tyro's first box in one line: option, value, what is expected; and where to read more."""
    lines = list(itertools.dropwhile(_is_rule, [line.strip("│ ") for line in message.splitlines()][1:]))  # no title
    first = " ".join(itertools.takewhile(lambda line: not _is_rule(line), lines)) or " ".join(message.split())
    first = re.sub(r"^Error parsing [^:]+: ", "", first).rstrip(". ") + _suggestion(lines)
    for pattern, expected in _VALUE_ERRORS:
        match = re.search(pattern, first)
        if match is not None:
            value = match["value"]
            option = words[words.index(value) - 1] if value in words[1:] else "an option"
            choices = sorted(set(re.findall(r"'([^']*)'", first.split("Expected")[-1])) - {"None"})
            first = f"{option} is {value!r}; expected {expected or ', '.join(choices)}"
            break
    command = words[0] if words and words[0] in commands.NAMES else "COMMAND"
    rewordings = (
        (r"PATH (.+?)\. \(required\)", r"PATH (\1),"),
        (r"^Unrecognized options: ([^-].*; expected one of )", r"no such command: \1"),
        (r"^Missing value for argument '(-\S+)'.*", r"nothing is given after \1; expected a value"),
        (r"^Missing value for argument '.*", f"missing from hvf {command}: PATH, or an option is mistyped"),
    )
    for pattern, better in rewordings:
        first = re.sub(pattern, better, first).rstrip(",")
    more = f"hvf {command} --help lists the options"
    if first.startswith("Unrecognized options: ") and (stated := _facts_about_a_file(words)):
        first = first.partition("; perhaps ")[0]
        more = f"hvf prepare takes {' and '.join(stated)}, and writes a BVH file for hvf {command}"
    return f"{first[0].lower()}{first[1:]}; {more}"


def _facts_about_a_file(words: Sequence[str]) -> list[str]:
    """Options among the words that state facts about a motion file: remarks on files advise them to all commands."""
    from models.mocap.retargeting.hints import Hints  # imported late: it loads NumPy

    known = {"--" + field.name.replace("_", "-") for field in fields(Hints)}
    return [option for word in words if (option := word.split("=")[0]) in known]


def _suggestion(lines: Sequence[str]) -> str:
    """What tyro suggests below its message: commands, or options with similar names."""
    text = " ".join(line for line in lines if not _is_rule(line))
    if found := re.search(r"Available subcommands: (.*?) For full helptext", text):
        return f"; expected one of {found[1]}"
    below = itertools.dropwhile(lambda line: not line.startswith("Perhaps you meant"), lines)
    similar = [
        line.split()[0] for line in itertools.takewhile(lambda line: not _is_rule(line), below) if line[:2] == "--"
    ]
    return f"; perhaps {' or '.join(similar)} is meant" if similar else ""


def _is_rule(line: str) -> bool:
    return bool(line) and set(line) <= set("─-")


_VALUE_ERRORS = (
    (r"could not convert string to float: '(?P<value>[^']*)'", "a number"),
    (r"invalid literal for int\(\) with base 10: '(?P<value>[^']*)'", "a whole number"),
    (r"invalid choice '(?P<value>[^']*)'", ""),
)
"""Patterns of tyro's messages on a wrong value, and what is expected; empty where tyro lists the choices itself."""


if __name__ == "__main__":
    sys.exit(main())
