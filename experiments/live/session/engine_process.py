"""The process of the engine, so that the servo never waits for the page nor for the page's Python interpreter."""

import os
import queue
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_POINT, TRACE_RIVER
from controllers.safety.faults import FAULT_CODE, FAULT_VALUE
from controllers.state import HAND_POSITION, HAND_SWITCH, POSITION, VELOCITY
from experiments.live.session import messages
from experiments.live.session.engine import Drag, Engine
from experiments.live.session.takes import Take
from experiments.live.session.workers import PageProcess
from experiments.setups.session import Session, default_poses
from experiments.setups.wiring import wire
from geometry.arrays import Array
from geometry.errors import HvfError
from sim.compilation.unit_workers import compile_units, missing_units
from sim.compilation.units import Unit
from sim.errors import SimError
from sim.hardware.process_start import parent_id
from sim.loop.channels import configuration_size, shown_configuration
from sim.loop.field_slice import field_slice
from sim.recording.recorder import DiskFull
from sim.viewer.shown import COURSE_POINTS

# [s] shortest time between two pictures: every other block of 8 ms, so that each page frame is new
MIN_FRAME_INTERVAL = 0.012
SLICE_INTERVAL = 0.25  # [s] between two computations of the field slice
SLICE_WIDTH = 0.14  # [m] side of the slice
IDLE_POLL_INTERVAL = 0.01  # [s] between two polls of the page while nothing runs
MAX_BACKLOG = 0.1  # [s] of delay above which the loop does not catch up


class EngineProcess(PageProcess):
    """The page's handle of the engine's process: boards to read and write, and a queue in each direction."""

    def __init__(self) -> None:
        self.shown, self.held = messages.Board(messages.SHOWN), messages.Board(messages.HELD)
        self.held.write({"pace": 1.0})
        # Not a daemon, as it starts compiler processes.
        super().__init__(_main, (self.shown, self.held), daemon=False, name="hvf-servo")

    def close(self) -> None:
        """End the process; a take in progress is saved."""
        self.ask(messages.Order.QUIT)
        self._process.join(30.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._close_queues()
        self.shown.close()
        self.held.close()


def _main(shown: messages.Board, held: messages.Board, orders: Any, answers: Any) -> None:
    _EngineLoop(shown, held, orders, answers).run()


class _EngineLoop:
    """The loop of the process: execute orders, run a block, send a picture, wait for the wall clock."""

    def __init__(self, shown: messages.Board, held: messages.Board, orders: Any, answers: Any):
        self._shown, self._held, self._orders, self._answers = shown, held, orders, answers
        self._engine: Engine | None = None
        self._take: Take | None = None
        self._parent, self._is_running = parent_id(), True
        self._last_picture_time, self._last_slice_time, self._steps_done = 0.0, 0.0, 0.0
        self._pace_sample = 0.0, 0.0
        self._curve_count, self._curve_changed = 0, True

    def run(self) -> None:
        """Run until `Order.QUIT`, or until the page's process has ended."""
        origin, pace = time.perf_counter(), 1.0
        elapsed = 0.0
        while self._is_running and os.getppid() == self._parent:
            self._process_orders()
            held = self._held.read()
            engine = self._engine
            paused, steps = held["paused"][0] > 0.0, held["steps"][0]
            # Nothing is measured, or shown in its place, before the first block: it runs even while time is paused.
            if engine is None or (paused and steps <= self._steps_done and engine.tick > 0):
                self._steps_done = min(self._steps_done, steps)
                time.sleep(IDLE_POLL_INTERVAL)
                self._send_picture()
                origin, elapsed = time.perf_counter(), 0.0
                continue
            if paused:
                self._steps_done += 1.0
            else:
                self._steps_done = steps
            self._run_block(engine)
            if held["pace"][0] != pace:
                pace, origin, elapsed = max(float(held["pace"][0]), 0.01), time.perf_counter(), 0.0
            elapsed += engine.seconds / pace
            remaining = origin + elapsed - time.perf_counter()
            if remaining > 0.0:
                time.sleep(remaining)
            elif remaining < -MAX_BACKLOG:
                origin, elapsed = time.perf_counter(), 0.0
        if self._engine is not None:
            self._stop(self._engine)

    def _update_drag(self, engine: Engine) -> None:
        held = self._held.read()
        engine.drag = Drag(held["target"], held["pressed"][0] > 0.0) if held["grip"][0] > 0.0 else None

    def _run_block(self, engine: Engine) -> None:
        self._update_drag(engine)
        logs = engine.advance()
        if self._take is not None:
            try:
                self._take.add(logs, engine)
            except DiskFull as error:
                self._take = None
                self._answers.put(messages.Refused(str(error)))
        self._send_picture()

    def _process_orders(self) -> None:
        while self._is_running:
            try:
                order = self._orders.get_nowait()
            except queue.Empty:
                return
            try:
                self._execute(order)
            except (HvfError, OSError) as error:
                self._answers.put(messages.Refused(str(error)))

    def _execute(self, order: object) -> None:
        if isinstance(order, messages.Build):
            self._build(order)
        elif order is messages.Order.QUIT:
            self._is_running = False
        elif self._engine is not None:
            self._update_drag(self._engine)
            self._execute_on_engine(order, self._engine)
            self._curve_changed = True

    def _execute_on_engine(self, order: object, engine: Engine) -> None:
        if order in (messages.Order.RESET, messages.Order.STOP) or isinstance(order, messages.GoBack | messages.Record):
            self._stop(engine)  # a take must be continuous in time
        match order:
            case messages.SetGains(config):
                engine.set_gains(config)
            case messages.GoBack(t):
                engine.back_to(t)
            case messages.Perform(now):
                engine.perform(now)
            case messages.Record(folder):
                self._take = Take(folder, engine)
            case messages.Order.RESET:
                engine.reset()
            case messages.Order.UNDO:
                engine.undo()
            case messages.Order.REDO:
                engine.redo()
            case messages.Order.REARM:
                engine.rearm()
            case _:
                pass

    def _stop(self, engine: Engine) -> None:
        if self._take is None:
            return
        take, self._take = self._take, None
        self._answers.put(messages.Progress("saving the take", 0.5))
        try:
            take.end(engine)
            self._answers.put(messages.Saved(take.folder))
        except (SimError, OSError) as error:
            self._answers.put(messages.Refused(str(error)))

    def _build(self, order: messages.Build) -> None:
        if self._engine is not None:
            self._stop(self._engine)
        self._answers.put(messages.Progress("setting up the run", 0.1))
        session = wire(order.config, ready=self._compile)
        self._engine = Engine(session)
        self._poses = None if session.parts.maps.plays_rivers else default_poses(session)
        self._curve_changed = True
        self._compute_slice(self._engine)  # compiles or loads its code now, not during the run
        self._answers.put(_built_message(session, self._engine))
        self._send_picture()

    def _compile(self, units: Sequence[Unit]) -> None:
        missing = missing_units(units)
        done = 0
        prefix = "compiling once what this run needs"

        def report_progress(unit: Unit) -> None:
            nonlocal done
            done += 1
            self._answers.put(messages.Progress(f"{prefix}: {done} of {len(missing)}", done / len(missing)))

        if missing:
            self._answers.put(messages.Progress(f"{prefix}: 0 of {len(missing)}; it takes a minute or two", 0.02))
            compile_units(missing, report_progress)

    def _send_picture(self) -> None:
        now, engine = time.perf_counter(), self._engine
        if engine is None or now - self._last_picture_time < MIN_FRAME_INTERVAL:
            return
        servo = engine.session.servo
        self._last_picture_time = now
        trace, hand = engine.memory, servo.device.hand
        shown: dict[str, Any] = {
            "t": engine.time, "fault": servo.device.faults[[FAULT_CODE, FAULT_VALUE]], "performs": engine.performs,
            "recording": 0.0 if self._take is None else self._take.seconds(engine) + engine.period,
            "qpos": shown_configuration(servo),
            "reference": servo.reference.pose, "p": hand[POSITION], "switch": hand[HAND_SWITCH],
            "force": servo.field.force, "user": servo.device.force, "distance": trace[TRACE_DISTANCE],
            "residual": float(np.linalg.norm(servo.figure.applied[:3])),
            "target": np.full(3, np.nan) if engine.drag is None else engine.drag.target,
            "ghost": self._ghost_pose(trace, servo.reference.pose),
        }  # fmt: skip
        if now - self._last_slice_time > SLICE_INTERVAL:
            previous_time, previous_simulated = self._pace_sample
            shown["pace"] = 0.0 if previous_time == 0.0 else (engine.time - previous_simulated) / (now - previous_time)
            self._last_slice_time, self._pace_sample = now, (now, engine.time)
            shown["cost"], shown["bends"] = engine.cost(), engine.bends()
            if self._held.rows["slice"][0] > 0.0:
                shown["slice"] = self._compute_slice(engine)
        is_bending = self._shown.rows["switch"][0] > 0.0 and engine.tubes is not None
        if self._curve_changed or is_bending:
            self._curve_changed, self._curve_count = is_bending, self._curve_count + 1
            shown["curve"], shown["bends"] = self._curve_count, engine.bends()
            shown["course"] = _curve_points(engine)
        self._shown.write(shown)

    def _ghost_pose(self, trace: Array, pose: Array) -> Array:
        """Pose of the default animation; where rivers play their own clips, that of the animation itself."""
        if self._poses is None or not np.isfinite(trace[TRACE_DISTANCE]):
            return pose
        nearest, phase, river = trace[TRACE_POINT : TRACE_POINT + 3], trace[TRACE_PHASE], trace[TRACE_RIVER]
        return self._poses(nearest[None].copy(), np.array([phase]), np.array([river]))[0]

    def _compute_slice(self, engine: Engine) -> Array:
        """Points and forces of the field on the horizontal plane through the stylus, shape (n, 6)."""
        hand = engine.session.servo.device.hand.copy()
        points = slice_points(float(hand[HAND_POSITION + 2]))
        forces = np.zeros_like(points)
        if not engine.session.parts.maps.plays_rivers:
            hand[VELOCITY] = 0.0
        field_slice(engine.field, hand, points, forces)
        return np.hstack([points, forces])


def slice_points(height: float) -> Array:
    """Grid points in a horizontal plane at a height in H [m], shape (81, 3)."""
    side = np.linspace(-0.5 * SLICE_WIDTH, 0.5 * SLICE_WIDTH, messages.SLICE_SIDE)
    x, y = np.meshgrid(side, side)
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1)


def _curve_points(engine: Engine) -> Array:
    """Points of the curve as currently bent, in H [m], shape (COURSE_POINTS, 3)."""
    curve = engine.session.curve if engine.tubes is None else engine.tubes.edited(engine.memory)
    return curve.point(np.linspace(curve.start, curve.end, COURSE_POINTS))


def _built_message(session: Session, engine: Engine) -> messages.Built:
    static = session.static()
    names = ("curve", "river_names", "river_curves", "tube_radius", "tube_name", "title", "figure", "p_WH", "scene")
    assert configuration_size(session.servo) <= messages.SHOWN["qpos"]
    return messages.Built(
        engine.config,
        {name: static[name] for name in names if name in static},
        engine.tubes is not None,
        session.remarks,
    )
