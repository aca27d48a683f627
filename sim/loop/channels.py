"""Logs of a block of ticks, and the channels recorded from them, which depend on the body that follows the hand."""

from collections.abc import Callable

import mujoco
import numpy as np

from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_POINT, TRACE_RIVER, TRACE_SIZE
from controllers.state import (
    HAND_ANGULAR_VELOCITY,
    HAND_QUATERNION,
    HAND_SIZE,
    HAND_SWITCH,
    HAND_TIME,
    HAND_VELOCITY,
    POSITION,
    VELOCITY,
)
from geometry.arrays import Array
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import pose_errors
from sim.body.drive import KinematicFigure, NoFigure
from sim.body.figure_state import REPORT_DOWN, REPORT_FLIES, REPORT_RESIDUAL, REPORT_SATURATED, FigureState
from sim.body.robot import RobotState, tool_positions
from sim.devices.device import user_torques
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.recording.recorder import Group, Recorder
from sim.world.world import World

Channels = Callable[[TickLog, FrameLog, int], dict[str, dict[str, Array]]]
"""Gives the channels of a block of n ticks, by group and name; a channel that is added here is recorded."""


def configuration_size(servo: Servo) -> int:
    """Length of a recorded configuration: the world's qpos, plus the pose of a figure that is only shown."""
    shown = len(servo.reference.pose) if isinstance(servo.figure, KinematicFigure) else 0
    return len(servo.plant.qpos) + shown


def shown_configuration(servo: Servo) -> Array:
    """The current configuration: the world's qpos, plus the pose of a figure that is only shown."""
    if isinstance(servo.figure, KinematicFigure):
        return np.concatenate([servo.plant.qpos, servo.reference.pose])
    return servo.plant.qpos


def make_logs(servo: Servo, ticks: int) -> tuple[TickLog, FrameLog]:
    """Empty logs for a block of ticks."""
    plant = servo.plant
    frames = -(-ticks // servo.figure_ticks)
    return (
        TickLog(
            hand=np.zeros((ticks, HAND_SIZE)), field=np.zeros((ticks, 6)), force=np.zeros((ticks, 3)),
            user=np.zeros((ticks, 3)), tank=np.zeros((ticks, 2)), torque=np.zeros((ticks, 3)),
            trace=np.zeros((ticks, TRACE_SIZE)), ctrl=np.zeros((ticks, len(plant.ctrl))),
            applied=np.zeros((ticks, plant.substeps, user_torques(servo.device))),
            residual=np.zeros((ticks, len(servo.figure.applied))), fault=np.zeros((ticks, 3)),
        ),
        FrameLog(
            t=np.zeros(frames), qpos=np.zeros((frames, configuration_size(servo))),
            reference=np.zeros((frames, len(servo.reference.pose))),
            report=np.zeros((frames, len(servo.figure.report))), ground=np.zeros((frames, 3)),
        ),
    )  # fmt: skip


def groups(servo: Servo, world: World) -> dict[str, Group]:
    """The channels that a run records, for `Recorder`: ``ticks`` at the servo's rate, ``frames`` at the body's."""
    n, rate = servo.figure_ticks, 1.0 / servo.plant.period
    blocks = channels(servo, world)(*make_logs(servo, n), n)  # whose rows have the shapes of those to be recorded
    rates = {"ticks": rate, "frames": rate / servo.figure_ticks}
    return {
        group: Group(rates[group], {name: block.shape[1:] for name, block in arrays.items()})
        for group, arrays in blocks.items()
    }


def channels(servo: Servo, world: World) -> Channels:
    """A function that gives the channels of a block.

    ``frames`` holds tracking errors, residual and ground force only for a figure in the physics, the reference only if
    there is a body, and joint angles [rad] and tool positions [m] only for a robot arm, which has no residual.
    """
    body, root = servo.figure, world.pose_at
    arm = mujoco.MjData(world.body) if isinstance(body, RobotState) else None

    def block_channels(ticks: TickLog, frames: FrameLog, n: int) -> dict[str, dict[str, Array]]:
        m, tick_arrays = -(-n // servo.figure_ticks), tick_channels(ticks, n)
        if isinstance(body, FigureState):
            return {"ticks": tick_arrays, "frames": frame_channels(frames, m, root)}
        frame_arrays = {"t": frames.t[:m], "qpos": frames.qpos[:m]}
        if not isinstance(body, NoFigure):
            frame_arrays["reference"] = frames.reference[:m]
        if arm is not None:
            del tick_arrays["residual"]
            joints = frames.qpos[:m, root : root + len(world.body.qpos0)]
            frame_arrays |= {
                "joints": joints, "tool": tool_positions(world.body, arm, joints),
                "led": tool_positions(world.body, arm, frames.reference[:m]),
                "saturated": frames.report[:m, REPORT_SATURATED],
            }  # fmt: skip
        return {"ticks": tick_arrays, "frames": frame_arrays}

    return block_channels


def record_into(recorder: Recorder, servo: Servo, world: World) -> Callable[[TickLog, FrameLog, int], None]:
    """An observer that appends every block to a recorder made with `groups`."""
    block_channels = channels(servo, world)

    def observe(ticks: TickLog, frames: FrameLog, n: int) -> None:
        for group, block in block_channels(ticks, frames, n).items():
            recorder.append(group, block)

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
