"""Worker processes for tasks that would block the page: verdicts on gains, and preparation of motion files."""

import os
import queue
import time
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from experiments.live.session.gain_verdict import gain_verdicts
from models.errors import ModelError
from sim.hardware.process_start import parent_id, start_without_sigint

_CHECK_INTERVAL = 0.5  # [s] between two checks that the page's process still exists


class PageProcess:
    """A process beside the page's, with a queue in each direction.

    Parameters
    ----------
    main : callable
        Function that runs in the process, called with the arguments and the queues of requests and of answers.
    arguments : tuple
        Its first arguments.
    daemon : bool
        Whether it ends with the page's process; if so, it cannot start processes itself.
    name : str, optional
        Name of the process.
    """

    def __init__(
        self, main: Callable[..., None], arguments: tuple[object, ...], daemon: bool = True, name: str | None = None
    ):
        context = get_context("spawn")
        self._requests: Any = context.Queue()
        self._answers: Any = context.Queue()
        queues = self._requests, self._answers
        self._process = context.Process(target=main, args=(*arguments, *queues), daemon=daemon, name=name)
        start_without_sigint(self._process)

    def ask(self, what: object) -> None:
        """Send a request."""
        self._requests.put(what)

    def answer(self, seconds: float = 0.0) -> Any:
        """The next answer, waiting for at most `seconds` [s]; None if there is none."""
        try:
            return self._answers.get(timeout=seconds) if seconds > 0.0 else self._answers.get_nowait()
        except queue.Empty:
            return None

    @property
    def alive(self) -> bool:
        """Whether the process is running."""
        return self._process.is_alive()

    def _close_queues(self) -> None:
        """Close both queues without waiting for what they still hold."""
        for channel in (self._requests, self._answers):
            channel.close()
            channel.cancel_join_thread()


class Worker(PageProcess):
    """A process that answers requests; only the newest pending request counts.

    Parameters
    ----------
    does : callable
        Called in the process with two queues, of requests and of answers.
    """

    def __init__(self, does: Callable[[Any, Any], None]):
        super().__init__(_main, (does,))

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._process.terminate()
        self._process.join()
        self._close_queues()


def _main(work: Callable[[Any, Any], None], requests: Any, answers: Any) -> None:
    os.nice(2)  # the servo has priority
    work(requests, answers)


def newest(requests: Any) -> Any:
    """Wait for a request and return the newest one; None if the page's process has ended."""
    parent = parent_id()
    while True:
        try:
            request = requests.get(timeout=_CHECK_INTERVAL)
            break
        except queue.Empty:
            if os.getppid() != parent:
                return None
    while True:
        try:
            request = requests.get_nowait()
        except queue.Empty:
            return request


def verdicts(requests: Any, answers: Any) -> None:
    """Worker for verdicts on gains: answers (configuration, verdicts) to a configuration."""
    while (config := newest(requests)) is not None:
        answers.put((config, gain_verdicts(config)))


class Uploaded(NamedTuple):
    """Result of preparing a motion file: the file of the clip or None, and a line about it."""

    path: Path | None
    text: str


def preparation(requests: Any, answers: Any) -> None:
    """Worker for preparing clips: answers an `Uploaded` to a pair (source, target) of files."""
    from experiments.preparation.command import prepare_file
    from experiments.preparation.prepared_clip import is_prepared
    from experiments.preparation.prepared_file import summary
    from models.mocap.library import load
    from models.mocap.readers.own_bvh import write_bvh

    while (files := newest(requests)) is not None:
        source, target = files
        begin = time.perf_counter()
        try:
            loaded = load(source)
            if is_prepared(loaded):
                write_bvh(loaded.clip, target)
                text = f"{source.stem}: {loaded.clip.duration:.1f} s on the figure's own skeleton, taken as it is"
            else:
                said = "; ".join(line.strip() for line in summary(prepare_file(source, target, overwrite=True)))
                text = f"{said}, {time.perf_counter() - begin:.0f} s in all"
            answers.put(Uploaded(target, text))
        except (ModelError, ValueError, ArithmeticError) as error:
            answers.put(Uploaded(None, " ".join(str(error).replace(f"{source.parent}/", "").split())))
