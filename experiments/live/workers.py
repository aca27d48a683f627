"""Processes that do for the page what would make it wait: verdicts on gains, and the preparation of a capture."""

import os
import queue
import signal
import time
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from models.errors import ModelError

_LISTENS = 0.5  # [s] between two looks whether the page is still there


class Worker:
    """A process that is asked and tells; of what it is asked, only the newest counts.

    Parameters
    ----------
    does : callable
        Called in the process with two queues, of what is asked and of what is told.
    """

    def __init__(self, does: Callable[[Any, Any], None]):
        context = get_context("spawn")
        self._asked: Any = context.Queue()
        self._told: Any = context.Queue()
        self._process = context.Process(target=_main, args=(does, self._asked, self._told), daemon=True)
        self._process.start()

    def ask(self, what: object) -> None:
        """Have it done."""
        self._asked.put(what)

    def told(self) -> Any:
        """What it has told, or None."""
        try:
            return self._told.get_nowait()
        except queue.Empty:
            return None

    @property
    def alive(self) -> bool:
        """Whether the process is there."""
        return self._process.is_alive()

    def close(self) -> None:
        """End it, whatever it is about."""
        self._process.terminate()
        self._process.join()
        for line in (self._asked, self._told):
            line.close()
            line.cancel_join_thread()


def _main(does: Callable[[Any, Any], None], asked: Any, told: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(2)  # the servo goes before
    does(asked, told)


def newest(asked: Any) -> Any:
    """The last of what is asked; None, for ever, when the page has gone."""
    parent = os.getppid()
    while True:
        try:
            what = asked.get(timeout=_LISTENS)
            break
        except queue.Empty:
            if os.getppid() != parent:
                return None
    while True:
        try:
            what = asked.get_nowait()
        except queue.Empty:
            return what


def verdicts(asked: Any, told: Any) -> None:
    """Verdicts on the gains of configurations: tells (configuration, verdicts, whether there is more to come)."""
    from experiments.live.gain_verdict import GainVerdicts  # CasADi is started here, not in the page

    found = GainVerdicts()
    while (config := newest(asked)) is not None:
        for k, now in enumerate(found.of(config)):
            told.put((config, now, k == 0 and now[0].verdict == "certified"))
            if not asked.empty():
                break  # the slider has moved on


class Uploaded(NamedTuple):
    """A motion file that was prepared, or why not.

    Attributes
    ----------
    name : str
        Of the file.
    path : Path or None
        Of the clip; None if there is none.
    text : str
        What is said of it, in one line.
    """

    name: str
    path: Path | None
    text: str


def preparation(asked: Any, told: Any) -> None:
    """Prepared clips: asked for (source, target), tells an `Uploaded`."""
    from experiments.preparation.command import prepare_file, summary
    from models.mocap.library import load
    from models.mocap.readers.own_bvh import write_bvh

    while (files := newest(asked)) is not None:
        source, target = files
        begin = time.perf_counter()
        try:
            loaded = load(source)
            if loaded.report is None:  # the figure's own skeleton, as this page writes it: taken as it is
                write_bvh(loaded.clip, target)
                said = f"{source.stem}: {loaded.clip.duration:.1f} s on the figure's own skeleton, taken as it is"
            else:
                line = summary(prepare_file(source, target, overwrite=True))
                said = f"{line}, {time.perf_counter() - begin:.0f} s in all"
            told.put(Uploaded(source.name, target, said))
        except (ModelError, ValueError, ArithmeticError) as error:
            told.put(Uploaded(source.name, None, " ".join(str(error).replace(f"{source.parent}/", "").split())))
