"""Recorded channels of a run, depending on the body that follows the hand, and the observer that records them."""

from collections.abc import Callable

import mujoco
import numpy as np

from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_POINT, TRACE_RIVER
from controllers.state import (
    HAND_ANGULAR_VELOCITY,
    HAND_QUATERNION,
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
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.recording.recorder import Group, Recorder
from sim.world.world import World

Channels = Callable[[TickLog, FrameLog, int], dict[str, dict[str, Array]]]
"""Gives the channels of a block of n ticks, by group and name."""


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
    """The channels that a run records, for `Recorder`: ``ticks`` at the servo's rate, ``frames`` at the body's.

    ``frames`` holds tracking errors, residual and ground force only for a figure in the physics, the reference only if
    there is a body, and joint angles [rad] and tool positions [m] only for a robot arm, which has no residual.
    """
    plant, body = servo.plant, servo.figure
    ticks: dict[str, tuple[int, ...]] = {
        "t": (), "p": (3,), "quaternion": (4,), "v": (3,), "omega": (3,), "switch": (), "field": (6,),
        "force": (3,), "user": (3,), "tank": (), "tank_scale": (), "torque": (3,),
        "phase": (), "nearest": (3,), "distance": (), "river": (),
        "ctrl": (len(plant.ctrl),), "applied": (plant.substeps, servo.device.user_torques), "residual": (6,),
        "fault": (), "fault_value": (), "gaps": (),
    }  # fmt: skip
    frames: dict[str, tuple[int, ...]] = {"t": (), "qpos": (configuration_size(servo),)}
    if not isinstance(body, NoFigure):
        frames |= {"reference": servo.reference.pose.shape}
    if isinstance(body, FigureState):
        frames |= {
            "joint_error": (), "root_error": (), "residual": (6,), "ground": (3,), "flight": (), "down": (),
            "saturated": (),
        }  # fmt: skip
    if isinstance(body, RobotState):
        del ticks["residual"]
        frames |= {"joints": body.qpos.shape, "tool": (3,), "led": (3,), "saturated": ()}
    return {
        "ticks": Group(1.0 / plant.period, ticks), "frames": Group(1.0 / (plant.period * servo.figure_ticks), frames)
    }  # fmt: skip


def channels(servo: Servo, world: World) -> Channels:
    """A function that gives the channels of `groups` of a block."""
    body, root, names = servo.figure, world.pose_at, groups(servo)
    arm = mujoco.MjData(world.body) if isinstance(body, RobotState) else None

    def block_channels(ticks: TickLog, frames: FrameLog, n: int) -> dict[str, dict[str, Array]]:
        m = -(-n // servo.figure_ticks)
        tick_arrays = tick_channels(ticks, n)
        if isinstance(body, FigureState):
            frame_arrays = frame_channels(frames, m, root)
        else:
            frame_arrays = {"t": frames.t[:m], "qpos": frames.qpos[:m], "reference": frames.reference[:m]}
        if arm is not None:
            joints = frames.qpos[:m, root : root + len(world.body.qpos0)]
            frame_arrays |= {
                "joints": joints, "tool": tool_positions(world.body, arm, joints),
                "led": tool_positions(world.body, arm, frames.reference[:m]),
                "saturated": frames.report[:m, REPORT_SATURATED],
            }  # fmt: skip
        return {
            "ticks": {name: tick_arrays[name] for name in names["ticks"].channels},
            "frames": {name: frame_arrays[name] for name in names["frames"].channels},
        }

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
