"""Takes: recorded spans of a live session, each in a folder like those of ``hvf run``, for ``hvf report``."""

import time
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

from controllers.fields.stretchy_tubes import StretchyTubes
from experiments.config.part import to_dict, to_json
from experiments.files.curve_files import CURVE_FILE, save_curve
from experiments.files.json_text import json_text
from experiments.live.session.engine import Engine
from experiments.results.folder import CONFIG, RECORDING, SUMMARY, check_folder, clear_folder
from experiments.results.measures.run_measures import summarise
from experiments.results.measures.stretch_summary import stretch_summary
from experiments.results.measures.summary_parts import SpeedSummary
from experiments.runs.run import session_summary, write_animations
from experiments.setups.session import default_poses
from geometry.whole_files import write_text
from sim.errors import SimError
from sim.loop.channels import groups, record_into
from sim.loop.loop import peak_memory_mb
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording

LIVE = "dragged by hand on the live page; no configuration says what the hand did"
"""Text ``live`` of a take's recording, which marks that it cannot be reproduced from its configuration."""
MIN_TAKE_DURATION = 0.5  # [s] shortest take that is kept; a shorter one is a mouse slip


class Take:
    """A take that is being recorded.

    Its time begins at 0. Changes of gains and bends are recorded through their forces, not as events; the stored
    configuration is that at the end of the take.

    Parameters
    ----------
    folder : Path
        Folder to write into; it may not hold a run.
    engine : Engine
        The running engine.

    Raises
    ------
    SimError
        If the folder cannot be written, or holds a run.
    """

    def __init__(self, folder: Path, engine: Engine):
        check_folder(folder, overwrite=False)
        clear_folder(folder)
        self.folder, self._start_time = folder, engine.time
        self._wall_start = time.perf_counter()
        servo = engine.session.servo
        static = engine.session.static() | {"live": LIVE}
        config = to_dict(engine.config)
        self._recorder = Recorder(folder / RECORDING, config, engine.config.seed, groups(servo, engine.world), static)
        self._record_logs = record_into(self._recorder, servo, engine.world)
        self._handled_spans: list[tuple[float, float]] = []
        self._tick_count = 0

    def seconds(self, engine: Engine) -> float:
        """Duration so far [s]."""
        return engine.time - self._start_time

    def add(self, logs: tuple[TickLog, FrameLog], engine: Engine) -> None:
        """Record the last block; raises `DiskFull` if there is no room, which ends the recording."""
        ticks, frames = logs
        ticks.hand[:, 0] -= self._start_time
        frames.t[:] -= self._start_time
        self._record_logs(ticks, frames, len(ticks.hand))
        self._tick_count += len(ticks.hand)
        if engine.grabs_or_leads:
            begin, end = float(ticks.hand[0, 0]), float(ticks.hand[-1, 0])  # as recorded, so that no tick is omitted
            if self._handled_spans and begin - self._handled_spans[-1][1] < 1.5 * engine.period:
                begin = self._handled_spans.pop()[0]
            self._handled_spans.append((begin, end))

    def end(self, engine: Engine) -> tuple[str, ...]:
        """Measure and close the recording, and write the files of ``hvf run`` beside it; returns the summary's lines.

        Raises
        ------
        SimError
            If it is too short to be measured; it is then deleted.
        """
        seconds = self.seconds(engine)
        if not self._tick_count or seconds < MIN_TAKE_DURATION:
            self._recorder.close()
            (self.folder / RECORDING).unlink()
            with suppress(OSError):  # it may hold a user's files
                self.folder.rmdir()
            lasted = f"a take of {seconds:.2f} s" if self._tick_count else "a take while time was paused"
            raise SimError(f"{self.folder}: {lasted} is not kept; expected {MIN_TAKE_DURATION:g} s or more")
        self._recorder.flush()
        parts = replace(engine.session.parts, config=engine.config, handled=tuple(self._handled_spans))
        session = replace(engine.session, parts=parts)
        speed = SpeedSummary(seconds / (time.perf_counter() - self._wall_start), 0.0, peak_memory_mb())
        if engine.config.leads:
            summary = session_summary(self.folder, session, speed)
        else:  # other modes' own measures are of hands that a configuration tells what to do
            with Recording(self.folder / RECORDING) as recording:
                summary = summarise(
                    recording, default_poses(session), speed, session.world.warnings(), session.parts.handled
                )
        lines = summary.lines()
        tubes = engine.tubes
        if isinstance(tubes, StretchyTubes):
            lines = [stretch_summary(tubes, engine.memory).line(), *lines]
            save_curve(tubes.edited(engine.memory), self.folder / CURVE_FILE)
        results = asdict(replace(summary, remarks=session.remarks)) | {"lines": lines}
        self._recorder.close(results)
        write_text(self.folder / SUMMARY, json_text(results) + "\n")
        write_text(self.folder / CONFIG, to_json(engine.config))
        write_animations(self.folder, session)
        return tuple(lines)
