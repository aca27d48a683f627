"""State and actions of the live page, without its GUI: engine process, displayed values, undo, takes and clips."""

import re
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from experiments.config.run_config import RunConfig
from experiments.live.session import messages
from experiments.live.session.engine_process import EngineProcess
from experiments.live.session.gain_verdict import GainVerdict
from experiments.live.session.gains import with_gain
from experiments.live.session.workers import Uploaded, Worker, preparation, verdicts
from geometry.arrays import Array
from geometry.whole_files import atomic_file
from models.mocap.library import embedded_names
from models.mocap.readers.asf_amc import SKELETON_SUFFIX
from models.mocap.readers.formats import READABLE_NAMES, UPLOADABLE_SUFFIXES
from sim.errors import SimError

HISTORY_DURATION = 60.0  # [s] of history that can be viewed again
HISTORY_RATE = 30.0  # states stored per second of history
UNATTENDED_TIMEOUT = 60.0  # [s] without a browser after which a take is ended: longer than it takes to reload the page
MAX_UPLOAD_BYTES = 30_000_000  # largest motion file: about an hour of motion capture


class UndoableAction(NamedTuple):
    """An action that can be undone: a change of gains, or, without configurations, a bend of the curve."""

    before: RunConfig | None = None
    after: RunConfig | None = None


class Desk:
    """State of a live page and the actions on it; `poll` updates it.

    Parameters
    ----------
    folder : Path
        Folder of takes and clips.
    say : callable
        Called with each line of text for the person.
    """

    def __init__(self, folder: Path, say: Callable[[str], None]):
        self.folder, self._say = folder, say
        self.engine = EngineProcess()
        self.built: messages.Built | None = None
        self.config: RunConfig | None = None
        self.progress: messages.Progress | None = None
        self.verdict: tuple[GainVerdict, ...] = ()
        self.checking = False
        self.builds = 0
        self.preparing: tuple[str, float] | None = None
        self.clips: dict[str, Path] = {}
        self.history: deque[dict[str, Array]] = deque(maxlen=round(HISTORY_DURATION * HISTORY_RATE))
        self.now: dict[str, Array] = self.engine.shown.read()
        self._undo_stack: list[UndoableAction] = []
        self._redo_stack: list[UndoableAction] = []
        self._bend_count, self._expected_bends, self._watch_time = 0, 0, 0.0
        self._verdicts = Worker(verdicts)
        self._preparation: Worker | None = None

    # Displayed state

    def poll(self) -> None:
        """Process the messages of the engine and of the workers, and read the latest displayed values."""
        while (answer := self.engine.answer()) is not None:
            self._process_answer(answer)
        while (verdict := self._verdicts.answer()) is not None:
            config, now = verdict
            if config == self.config:
                self.verdict, self.checking = now, False
        if self._preparation is not None and (uploaded := self._preparation.answer()) is not None:
            self._add_clip(uploaded)
        if not self.engine.alive:
            raise SimError("the servo's process has ended; start hvf live again")
        now = self.engine.shown.read()
        if self.built is not None and now["t"][0] != self.now["t"][0]:
            self._store_in_history(now)
        self.now = now

    def _process_answer(self, answer: object) -> None:
        self.progress = answer if isinstance(answer, messages.Progress) else None
        if isinstance(answer, messages.Built):
            self.built, self.config = answer, answer.config
            self.builds += 1
            self.history.clear()
            self._undo_stack, self._redo_stack, self._bend_count, self._expected_bends = [], [], 0, 0
            self._request_verdict()
            for remark in answer.remarks:
                self._say(remark)
        elif isinstance(answer, messages.Refused):
            self._say(answer.text)
            if self.built is not None and self.config is not None and self.config.map == self.built.config.map:
                self._request_verdict()
        elif isinstance(answer, messages.Saved):
            self._say(f"Take kept in {answer.folder}.")

    def _store_in_history(self, now: dict[str, Array]) -> None:
        if now["t"][0] < self.now["t"][0]:
            self.history = deque((h for h in self.history if h["t"][0] <= now["t"][0]), maxlen=self.history.maxlen)
        bends = int(now["bends"][0])
        if bends > self._bend_count and bends > self._expected_bends:
            self._undo_stack.append(UndoableAction())
            self._redo_stack.clear()
        self._bend_count = self._expected_bends = bends
        if not self.history or now["t"][0] - self.history[-1]["t"][0] >= 1.0 / HISTORY_RATE:
            if self.history and now["curve"][0] == self.history[-1]["curve"][0]:
                now["course"] = self.history[-1]["course"]
            self.history.append(now)

    def at(self, seconds_ago: float) -> dict[str, Array]:
        """The displayed values of `seconds_ago` [s] before now, from the history; the current ones for 0."""
        if seconds_ago <= 0.0 or not self.history:
            return self.now
        wanted = self.now["t"][0] - seconds_ago
        return min(self.history, key=lambda h: abs(float(h["t"][0]) - wanted))

    # Actions

    def build(self, config: RunConfig) -> None:
        """Build another run; the current one continues until it is ready."""
        self.let_go()
        self.engine.ask(messages.Build(config))

    def hold(self, target: Array, pressed: bool) -> None:
        """Hold the stylus with a target position in H [m], with its switch pressed or not."""
        self.engine.held.write({"grip": 1.0, "pressed": float(pressed), "target": target})

    def press(self, pressed: bool) -> None:
        """Press or release the switch of the held stylus."""
        self.engine.held.write({"pressed": float(pressed)})

    def let_go(self) -> None:
        """Release the stylus."""
        self.engine.held.write({"grip": 0.0, "pressed": 0.0})

    @property
    def holds(self) -> bool:
        """Whether a person holds the stylus."""
        return bool(self.engine.held.rows["grip"][0] > 0.0)

    @property
    def target(self) -> Array:
        """Target position of the held stylus in H [m], shape (3,)."""
        return self.engine.held.rows["target"].copy()

    @property
    def paused(self) -> bool:
        """Whether the simulation is paused."""
        return bool(self.engine.held.rows["paused"][0] > 0.0)

    def pause(self, paused: bool) -> None:
        """Pause the simulation, or let it continue."""
        self.engine.held.write({"paused": float(paused)})

    def step(self) -> None:
        """Pause, and advance by a block of 8 ms."""
        self.engine.held.write({"paused": 1.0, "steps": self.engine.held.rows["steps"][0] + 1.0})

    def pace(self, share: float) -> None:
        """Set the pace of the simulation, as a share of real time."""
        self.engine.held.write({"pace": share})

    def look(self, at_field: bool) -> None:
        """Switch the computation of the field on a slice on or off."""
        self.engine.held.write({"slice": float(at_field)})

    def reset(self) -> None:
        """Return to the beginning."""
        self.let_go()
        self.engine.ask(messages.Order.RESET)

    def go_back(self, seconds_ago: float) -> None:
        """Continue from the last stored state before the time `seconds_ago` [s] ago; one state is stored per second."""
        self.let_go()
        self.engine.ask(messages.GoBack(float(self.at(seconds_ago)["t"][0])))

    def perform(self, now: bool) -> None:
        """Perform the bent curve, or bend it again."""
        self.engine.ask(messages.Perform(now))

    def rearm(self) -> None:
        """Clear a latched fault."""
        self.engine.ask(messages.Order.REARM)

    def set_gain(self, name: str, value: float) -> None:
        """Set a gain.

        Raises
        ------
        ParameterError
            If the value is outside its interval.
        """
        if self.config is None:
            return
        before, after = self.config, with_gain(self.config, name, value)
        if before == after:
            return
        last = self._undo_stack[-1] if self._undo_stack else UndoableAction()
        if last.after is before and self._changed_gains(last) == {name}:
            self._undo_stack[-1] = UndoableAction(last.before, after)  # moves of a slider are undone together
        else:
            self._undo_stack.append(UndoableAction(before, after))
        self._redo_stack.clear()
        self._apply_config(after)

    def _changed_gains(self, doing: UndoableAction) -> set[str]:
        if doing.before is None or doing.after is None:
            return set()
        before, after = vars(doing.before.mode), vars(doing.after.mode)
        return {name for name in before if before[name] != after[name]}

    def undo(self) -> None:
        """Undo the last action: a bend or a change of gains."""
        if not self._undo_stack:
            self._say("Nothing to undo.")
            return
        self._redo_stack.append(self._undo_stack.pop())
        self._go_to(self._redo_stack[-1].before, -1)

    def redo(self) -> None:
        """Redo the last undone action."""
        if not self._redo_stack:
            self._say("Nothing to redo.")
            return
        self._undo_stack.append(self._redo_stack.pop())
        self._go_to(self._undo_stack[-1].after, 1)

    def _go_to(self, config: RunConfig | None, bends: int) -> None:
        """Apply a configuration; without one, undo (−1) or redo (1) a bend."""
        if config is not None:
            self._apply_config(config)
            return
        self._expected_bends = self._bend_count + bends
        self.engine.ask(messages.Order.REDO if bends > 0 else messages.Order.UNDO)

    def _apply_config(self, config: RunConfig) -> None:
        self.config = config
        self.engine.ask(messages.SetGains(config))
        self._request_verdict()

    def _request_verdict(self) -> None:
        self.checking = True
        self._verdicts.ask(self.config)

    # Takes and clips

    @property
    def records(self) -> bool:
        """Whether a take is being recorded."""
        return bool(self.now["recording"][0] > 0.0)

    def takes(self) -> tuple[str, ...]:
        """Names of the existing takes."""
        folder = self.folder / "takes"
        return tuple(sorted(path.parent.name for path in folder.glob("*/edited.bvh")))

    def take(self, name: str) -> Path:
        """Folder of a take."""
        return self.folder / "takes" / name

    def record(self, name: str) -> None:
        """Begin a take.

        Raises
        ------
        SimError
            If the name is invalid, or another take has it.
        """
        if not re.fullmatch(r"[\w][\w .-]{0,60}", name):
            raise SimError(f"a take cannot be named {name!r}; expected letters, digits, space, dot and dash")
        if self.take(name).exists():
            raise SimError(f"there is a take {name!r} already; expected another name")
        self.engine.ask(messages.Record(self.take(name)))

    def watched(self, browsers: int) -> None:
        """Called periodically with the number of browsers; after `UNATTENDED_TIMEOUT` without one, a take is ended."""
        now = time.monotonic()
        if browsers or not self.records:
            self._watch_time = now
        elif now - self._watch_time > UNATTENDED_TIMEOUT:
            self._watch_time = now
            self._say(f"The take was ended: no browser was connected for {UNATTENDED_TIMEOUT:g} s.")
            self.stop()

    def stop(self) -> None:
        """End the take; it is measured and saved."""
        self.engine.ask(messages.Order.STOP)

    def upload(self, name: str, content: bytes) -> None:
        """Have a motion file prepared in a separate process.

        Raises
        ------
        SimError
            If it is too large or of an unsupported format, or another file is being prepared.
        """
        file = Path(name).name
        if (suffix := Path(file).suffix.lower()) not in UPLOADABLE_SUFFIXES:
            raise SimError(f"{file} is no motion file; expected {READABLE_NAMES}")
        if len(content) > MAX_UPLOAD_BYTES:
            raise SimError(
                f"{file} has {len(content) / 1e6:.1f} MB; expected at most {MAX_UPLOAD_BYTES / 1e6:.0f} MB; "
                "hvf prepare takes larger ones"
            )
        if self.preparing is not None:
            raise SimError(f"{self.preparing[0]} is being prepared; expected one file at a time")
        uploads = self.folder / "uploads"
        uploads.mkdir(parents=True, exist_ok=True)
        with atomic_file(uploads / file) as upload:
            upload.write(content)
        if suffix == SKELETON_SUFFIX:
            self._say(f"{file}: the skeleton is kept; its AMC can come now.")
            return
        target = self.folder / "clips" / f"{Path(file).stem}.bvh"
        target.parent.mkdir(parents=True, exist_ok=True)
        self._preparation = self._preparation or Worker(preparation)
        self.preparing = file, time.monotonic()
        self._preparation.ask((uploads / file, target))

    def _add_clip(self, uploaded: Uploaded) -> None:
        self.preparing = None
        if uploaded.path is not None:
            self.offer(uploaded.path)
        self._say(uploaded.text)

    def offer(self, file: Path) -> None:
        """Offer a motion file as a clip, by its stem or, where another clip has that name, by its name or its path."""
        if file not in self.clips.values():
            taken = (*self.clips, *embedded_names())
            name = next(name for name in (file.stem, file.name, str(file)) if name not in taken)
            self.clips[name] = file

    def close(self) -> None:
        """End all processes; a take in progress is saved."""
        self.engine.close()
        self._verdicts.close()
        if self._preparation is not None:
            self._preparation.close()


def numbers(history: deque[dict[str, Array]], names: tuple[str, ...], seconds: float) -> tuple[Array, ...]:
    """Times [s], and norms of the named values over the last `seconds` [s] of the history, for plots."""
    if not history:
        return (np.zeros(2), *(np.zeros(2) for _ in names))
    last = history[-1]["t"][0]
    rows = [h for h in history if h["t"][0] >= last - seconds]
    times = np.array([h["t"][0] for h in rows])
    return (times, *(np.array([float(np.linalg.norm(h[name])) for h in rows]) for name in names))
