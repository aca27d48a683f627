"""A run: compiled blocks of servo ticks one after the other, streamed to a recorder in constant memory."""

import time
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np

from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_POINT, TRACE_RIVER, TRACE_SIZE
from controllers.state import (
    HAND_ANGULAR_VELOCITY,
    HAND_QUATERNION,
    HAND_SWITCH,
    HAND_TIME,
    HAND_VELOCITY,
    POSITION,
    VELOCITY,
    Array,
    HandState,
)
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import pose_difference
from sim.body.figure_state import REPORT_DOWN, REPORT_FLIES, REPORT_RESIDUAL, REPORT_SATURATED, FigureState
from sim.body.robot import RobotState
from sim.body.unsimulated import KinematicFigure, NoFigure
from sim.devices.device import read_device, ticks_of
from sim.errors import SimError
from sim.loop.servo import FrameLog, Servo, TickLog, run_block
from sim.recording.recorder import Group, Recorder
from sim.world.robot_world import RobotWorld
from sim.world.world import World

BLOCK_SECONDS = 0.2  # simulated time of a block [s]: the clock and the recorder are served once per block


class RunTimes(NamedTuple):
    """How fast a run was.

    Attributes
    ----------
    simulated, wall : float
        Simulated time, and the wall-clock time it took [s].
    """

    simulated: float
    wall: float

    @property
    def real_time_factor(self) -> float:
        """Simulated time divided by wall-clock time."""
        return self.simulated / self.wall if self.wall > 0.0 else float("inf")


def make_logs(servo: Servo, ticks: int) -> tuple[TickLog, FrameLog]:
    """Empty logs for a block of ticks."""
    plant = servo.plant
    frames = -(-ticks // servo.figure_ticks)
    return (
        TickLog(
            hand=np.zeros((ticks, 15)), field=np.zeros((ticks, 6)), force=np.zeros((ticks, 3)),
            user=np.zeros((ticks, 3)), tank=np.zeros((ticks, 2)), torque=np.zeros((ticks, 3)),
            trace=np.zeros((ticks, TRACE_SIZE)), ctrl=np.zeros((ticks, len(plant.ctrl))),
            applied=np.zeros((ticks, plant.substeps, servo.device.user_torques)),
            residual=np.zeros((ticks, len(servo.figure.applied))), fault=np.zeros((ticks, 3)),
        ),
        FrameLog(
            t=np.zeros(frames), qpos=np.zeros((frames, configuration_size(servo))),
            reference=np.zeros((frames, len(servo.reference.pose))),
            report=np.zeros((frames, len(servo.figure.report))), ground=np.zeros((frames, 3)),
        ),
    )  # fmt: skip


def configuration_size(servo: Servo) -> int:
    """Length of a recorded configuration: the world's qpos, plus the pose of a figure that is only shown."""
    shown = len(servo.reference.pose) if isinstance(servo.figure, KinematicFigure) else 0
    return len(servo.plant.qpos) + shown


def shown_configuration(servo: Servo) -> Array:
    """The current configuration: the world's qpos, plus the pose of a figure that is only shown."""
    if isinstance(servo.figure, KinematicFigure):
        return np.concatenate([servo.plant.qpos, servo.reference.pose])
    return servo.plant.qpos


def groups(servo: Servo) -> dict[str, Group]:
    """The channels that a run records, for `Recorder`: ``ticks`` at the servo's rate, ``frames`` at the figure's.

    ``frames`` holds tracking errors, residual and ground force only for a body in the physics, and the reference only
    if there is a figure.
    """
    plant = servo.plant
    ticks = Group(
        1.0 / plant.period,
        {
            "t": (), "p": (3,), "quaternion": (4,), "v": (3,), "omega": (3,), "switch": (), "field": (6,),
            "force": (3,), "user": (3,), "tank": (), "tank_scale": (), "torque": (3,),
            "phase": (), "nearest": (3,), "distance": (), "river": (),
            "ctrl": (len(plant.ctrl),), "applied": (plant.substeps, servo.device.user_torques), "residual": (6,),
            "fault": (), "fault_value": (), "gaps": (),
        },
    )  # fmt: skip
    channels: dict[str, tuple[int, ...]] = {"t": (), "qpos": (configuration_size(servo),)}
    if not isinstance(servo.figure, NoFigure):
        channels |= {"reference": (N_POSE,)}
    if isinstance(servo.figure, FigureState | RobotState):
        channels |= {
            "joint_error": (), "root_error": (), "residual": (6,), "ground": (3,), "flight": (), "down": (),
            "saturated": (),
        }  # fmt: skip
    return {"ticks": ticks, "frames": Group(1.0 / (plant.period * servo.figure_ticks), channels)}


Observer = Callable[[TickLog, FrameLog, int], None]
"""Called after each block with its logs and the number of ticks in them; the logs are reused for the next block."""


class Loop:
    """A servo and its world, run block by block.

    Parameters
    ----------
    servo : Servo
        See `sim.loop.servo`.
    world : World or RobotWorld
        Kept alive here, since the servo holds addresses of its memory.
    observe : Observer, optional
        Called with each block; `record_into` makes one that records.
    block_seconds : float
        Simulated time of a block [s], rounded to whole figure updates.
    python_laws : sequence of callable
        `Program.python_laws` of the servo's field: each maps the measured hand to a wrench of six numbers. If there are
        any, blocks run tick by tick: the hand is sensed, the laws are called, the compiled loop does the rest.

    before_tick : callable, optional
        Called with the number of each tick before it runs, for example by a driver in Python that writes the readings
        of an `Exchange` and takes its commands; it may wait for the time of the tick. Blocks then run tick by tick.
    ask : callable, optional
        Called with the time [s] every `ask_seconds`, rounded up to whole figure updates, before the tick: it sets what
        a simulated person at the device intends (see `sim.users.intents.own`). A block ends before each call.

    Raises
    ------
    SimError
        If the number of laws differs from the number of slots that the field has for them.
    """

    def __init__(
        self,
        servo: Servo,
        world: World | RobotWorld,
        observe: Observer = lambda ticks, frames, n: None,
        block_seconds: float = BLOCK_SECONDS,
        python_laws: Sequence[Callable[[HandState], Array]] = (),
        before_tick: Callable[[int], None] | None = None,
        ask: Callable[[float], None] | None = None,
        ask_seconds: float = BLOCK_SECONDS,
    ):
        self.servo, self.world, self._observe = servo, world, observe
        every = servo.figure_ticks
        self._block = every * max(1, round(block_seconds / servo.plant.period / every))
        self._tick = 0
        self._one: tuple[TickLog, FrameLog] | None = None
        self._slots: list[int] = servo.field.slots.tolist()
        self._laws = tuple(python_laws)
        self._before_tick = before_tick
        self._ask, self._ask_ticks = ask, every * max(1, -int(-ask_seconds / servo.plant.period // every))
        if len(self._laws) != len(self._slots):
            raise SimError(
                f"the field has {len(self._slots)} slots for laws in Python, {len(self._laws)} are given; "
                "expected the program's python_laws"
            )

    @property
    def time(self) -> float:
        """Simulated time so far [s]."""
        return self._tick * self.servo.plant.period

    def run(self, seconds: float, progress: Callable[[float], None] = lambda _: None) -> RunTimes:
        """Continue the run for some simulated time.

        Parameters
        ----------
        seconds : float
            Rounded to whole figure updates.
        progress : callable
            Called with the simulated time after every block.

        Raises
        ------
        SimError
            If the device cannot deliver that many ticks: a replayed hand ends.
        """
        plant, every = self.servo.plant, self.servo.figure_ticks
        wanted = every * round(seconds / (plant.period * every))
        left, first = ticks_of(self.servo.device), self._tick
        if left is not None and first + wanted > left:
            end, rest = (first + wanted) * plant.period, (left - first) * plant.period
            raise SimError(
                f"the replayed hand ends after {left} ticks ({left * plant.period:g} s), the run would end after "
                f"{end:g} s; ask for {rest:g} s or less"
            )
        ticks, frames = make_logs(self.servo, self._block)
        begin = time.perf_counter()
        while self._tick < first + wanted:
            n = min(self._block, first + wanted - self._tick)
            if self._ask is not None:
                n = min(n, self._ask_ticks - self._tick % self._ask_ticks)
                self._asked()
            if self._laws or self._before_tick is not None:
                self._run_with_laws(n, ticks, frames)
            else:
                run_block(self.servo, self._tick, n, False, ticks, frames)
            self._tick += n
            self._observe(ticks, frames, n)
            progress(self.time)
        return RunTimes(wanted * plant.period, time.perf_counter() - begin)

    def step(self) -> tuple[TickLog, FrameLog]:
        """Run one tick; its logs have one row each: this tick, and the figure's last update."""
        if self._one is None:
            self._one = make_logs(self.servo, 1)
        ticks, frames = self._one
        self._asked()
        if self._laws or self._before_tick is not None:
            self._run_with_laws(1, ticks, frames)
        else:
            run_block(self.servo, self._tick, 1, False, ticks, frames)
        self._tick += 1
        return ticks, frames

    def _asked(self) -> None:
        if self._ask is not None and self._tick % self._ask_ticks == 0:
            self._ask(self.time)

    def _run_with_laws(self, n: int, ticks: TickLog, frames: FrameLog) -> None:
        servo, every = self.servo, self.servo.figure_ticks
        for k in range(n):
            tick, row = self._tick + k, k // every
            if self._before_tick is not None:
                self._before_tick(tick)
            read_device(servo.device, tick * servo.plant.period)
            hand = HandState.of(servo.device.hand)
            for slot, law in zip(self._slots, self._laws, strict=True):
                servo.field.memory[slot : slot + 6] = law(hand)
            tick_rows = TickLog(*(channel[k : k + 1] for channel in ticks))
            frame_rows = FrameLog(*(channel[row : row + 1] for channel in frames))
            run_block(servo, tick, 1, False, tick_rows, frame_rows)


def record_into(recorder: Recorder, servo: Servo, world: World) -> Observer:
    """An observer that appends every block to a recorder made with `groups`."""
    names = groups(servo)["frames"].channels

    def observe(ticks: TickLog, frames: FrameLog, n: int) -> None:
        recorder.append("ticks", tick_channels(ticks, n))
        recorder.append("frames", shown_channels(frames, -(-n // servo.figure_ticks), names, world.pose_at))

    return observe


def tick_channels(ticks: TickLog, n: int) -> dict[str, Array]:
    """The first n ticks of a block by channel."""
    hand, trace = ticks.hand[:n], ticks.trace[:n]
    return {
        "t": hand[:, HAND_TIME], "p": hand[:, POSITION], "quaternion": hand[:, HAND_QUATERNION:HAND_VELOCITY],
        "v": hand[:, VELOCITY], "omega": hand[:, HAND_ANGULAR_VELOCITY:HAND_SWITCH],
        "switch": hand[:, HAND_SWITCH],
        "field": ticks.field[:n], "force": ticks.force[:n], "user": ticks.user[:n],
        "tank": ticks.tank[:n, 0], "tank_scale": ticks.tank[:n, 1], "torque": ticks.torque[:n],
        "phase": trace[:, TRACE_PHASE], "nearest": trace[:, TRACE_POINT : TRACE_POINT + 3],
        "distance": trace[:, TRACE_DISTANCE], "river": trace[:, TRACE_RIVER],
        "ctrl": ticks.ctrl[:n], "applied": ticks.applied[:n], "residual": ticks.residual[:n],
        "fault": ticks.fault[:n, 0], "fault_value": ticks.fault[:n, 1], "gaps": ticks.fault[:n, 2],
    }  # fmt: skip


def shown_channels(frames: FrameLog, m: int, names: Collection[str], root: int) -> dict[str, Array]:
    """The recorded channels, `names`, of the first m figure updates of a block.

    `root` is the index of the figure's pose in qpos; it is needed only for a body in the physics.
    """
    channels = {"t": frames.t[:m], "qpos": frames.qpos[:m], "reference": frames.reference[:m]}
    if "joint_error" in names:
        channels = frame_channels(frames, m, root)
    return {name: channels[name] for name in names}


def frame_channels(frames: FrameLog, m: int, root: int) -> dict[str, Array]:
    """The first m figure updates of a block by channel; `root` is the index of the figure's pose in qpos."""
    reference, report = frames.reference[:m], frames.report[:m]
    joint_error, root_error = pose_errors(frames.qpos[:m, root : root + N_POSE], reference)
    return {
        "t": frames.t[:m], "qpos": frames.qpos[:m], "reference": reference, "joint_error": joint_error,
        "root_error": root_error, "residual": report[:, REPORT_RESIDUAL : REPORT_RESIDUAL + 6],
        "ground": frames.ground[:m], "flight": report[:, REPORT_FLIES], "down": report[:, REPORT_DOWN],
        "saturated": report[:, REPORT_SATURATED],
    }  # fmt: skip


def pose_errors(poses: Array, reference: Array) -> tuple[Array, Array]:
    """Pose errors: RMS over the joints of the angle between their rotations [rad], and distance of the roots [m].

    Parameters
    ----------
    poses, reference : Array
        Shape (n, 75) each.

    Returns
    -------
    joints, root : Array
        Shape (n,) each.
    """
    difference = pose_difference(poses, reference)
    turns = difference[:, 6:].reshape(len(poses), -1, 3)
    return np.sqrt(np.mean(np.sum(turns**2, axis=2), axis=1)), np.linalg.norm(difference[:, :3], axis=1)
