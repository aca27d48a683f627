"""Telerobotics: the same field and the same loop lead a robot arm of seven joints instead of a human figure."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from rich.console import Console

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.follow import Follow
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.robot_arm import ROBOT_ARM, RobotArm
from controllers.safety.energy_tank import river_power
from controllers.safety.limiter import ForceLimiter
from experiments.compiling import compile_once, compiled_parts
from experiments.config.run_config import ArmConfig
from experiments.files.json_text import json_text
from experiments.results.figures import STYLE
from experiments.results.report import write_report
from experiments.run import RECORDING, REPORT, SUMMARY, check_folder
from experiments.setups.budget import fastest, tank_for
from experiments.setups.hands import lap_pushes
from models.phantom.parameters import PREMIUM_1_5
from models.robot_arm.spec import ARM_JOINTS, TOOL, arm_lengths, arm_limits, arm_model
from models.scene import P_WH, PEDESTAL, PHANTOM, ROBOT
from sim.body.robot import REPORT_SATURATED, robot_state
from sim.compilation.kernel_units import law_units
from sim.devices.simulated import simulated_phantom
from sim.loop.loop import Loop, groups, tick_channels
from sim.loop.servo import Field, FrameLog, Servo, TickLog
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.reference.reference import check_reference, make_reference, poses_along
from sim.users.arm import Arm
from sim.viewer.palette import CURVE, FIELD, USER
from sim.viewer.replay_html import Target
from sim.world.phantom_port import phantom_port
from sim.world.plant import make_plant
from sim.world.robot_world import RobotWorld

Array = npt.NDArray[np.float64]

HOME = np.array([0.7, 0.0, 0.4])  # of the tool, in the frame of the arm's base [m]
TILT = np.radians(75.0)  # of the tool away from the vertical
ORIENTATION = np.array([np.cos(0.5 * TILT), 0.0, np.sin(0.5 * TILT), 0.0])
SCALE = 1.5
REACH = (0.07, 0.1)  # [m]
TURN = (np.radians(15.0), np.radians(25.0))
ARM_ANGLE = np.radians(30.0)
RATE = 60.0  # of the arm's computed torque [1/s]
FIGURE = "arm.png"
_TARGET = Target(ROBOT, "robot arm", "h(p, R)", 1.6)


@dataclass(frozen=True)
class ArmSummary:
    """What happened.

    Attributes
    ----------
    laps : float
    deviation_rms_mm : float
        Stylus from the curve, first second and pushes left out.
    tool_rms_mm, tool_max_mm : float
        Tool of the arm from where the stylus leads it, the first second left out.
    joints_rms_deg : float
        Joint angles from h(p, R), likewise.
    torque_share : float
        Largest torque over its motor's limit.
    nearest_limit_deg : float
        Least distance of a joint from its limit.
    real_time_factor : float
    """

    laps: float
    deviation_rms_mm: float
    tool_rms_mm: float
    tool_max_mm: float
    joints_rms_deg: float
    torque_share: float
    nearest_limit_deg: float
    real_time_factor: float

    def lines(self) -> list[str]:
        """What happened, a sentence each."""
        return [
            f"The stylus ran {self.laps:.2f} laps, {self.deviation_rms_mm:.2f} mm RMS from the curve when left alone.",
            f"The tool was {self.tool_rms_mm:.2f} mm RMS, at most {self.tool_max_mm:.2f} mm, from where the stylus "
            f"leads it; the joints {self.joints_rms_deg:.3f}° RMS from h.",
            f"The motors gave at most {100 * self.torque_share:.0f} % of their torque, and no joint came nearer to its "
            f"limit than {self.nearest_limit_deg:.0f}°.",
            f"It ran at {self.real_time_factor:.2f} × real time.",
        ]


def robot_arm_map() -> RobotArm:
    """The default map: the stylus leads the tool in front of the arm, 1.5 times as far as it moves itself."""
    arm = arm_model()
    return RobotArm(
        arm_lengths(arm), arm_limits(arm), HOME, ORIENTATION, SCALE, REACH, TURN, float(ARM_ANGLE), _evaluated
    )


def _evaluated(compiled: CompiledMap, points: Array) -> Array:
    poses = np.empty((len(points), len(ARM_JOINTS)))
    poses_along(compiled.kind, compiled.params, compiled.memory, points, poses)
    return poses


def tilted_circle(radius: float, lap: float) -> Trajectory:
    """A circle about the origin of H, tilted by 30° to the user, run through in `lap` seconds."""
    times = np.linspace(0.0, lap, 65)
    points = Trajectory.circle(radius, lap).point(times)
    tilt = np.radians(30.0)
    turned = np.stack([np.cos(tilt) * points[:, 0], points[:, 1], np.sin(tilt) * points[:, 0]], axis=1)
    turned[-1] = turned[0]
    return Trajectory(times, turned, periodic=True)


def wire_arm(
    config: ArmConfig, ready: Callable[[tuple[str, ...]], None] = lambda parts: None
) -> tuple[Servo, RobotWorld, Trajectory]:
    """Put a run together: servo, world and curve; `ready` as in `experiments.setups.wiring.wire`.

    Raises
    ------
    ModelError, ControllerError, SimError
        If a number is out of its interval, the rates do not divide, or the curve leaves the workspace.
    """
    if config.arm_ticks < 1:
        raise ParameterError(f"arm_ticks is {config.arm_ticks}; expected 1 or more servo ticks between two updates")
    if not 1.5 <= config.seconds < np.inf:
        raise ParameterError(f"a run of {config.seconds} s; expected 1.5 s or more, and finite")
    if config.seed < 0:
        raise ParameterError(f"seed is {config.seed}; expected 0 or more")
    for name in ("lap", "radius"):
        if not (np.isfinite(getattr(config, name)) and getattr(config, name) > 0.0):
            raise ParameterError(f"{name} is {getattr(config, name)}; expected a positive, finite number")
    world = RobotWorld(config.scene)
    curve = tilted_circle(config.radius, config.lap)
    program = Follow(curve, config.stiffness, config.damping, config.tube).program()
    period = config.scene.servo_period
    limiter = ForceLimiter(period)
    power = river_power(config.damping, fastest(curve))
    tank = tank_for(power, ((config.stiffness, config.tube),), config.radius, limiter)
    pushes = lap_pushes(config.lap, config.lap) if config.user == "push" else ()
    start = curve.point(curve.start) + np.random.default_rng(config.seed).normal(scale=1e-3, size=3)
    world.reset(start)
    stylus = np.empty(4)
    mujoco.mju_mat2Quat(stylus, world.data.site(PHANTOM + "tip").xmat)
    port = phantom_port(world.model, world.data, period, config.cutoff)
    check_reference(period * config.arm_ticks, config.smoothing, 0.0)
    # The map looks at its domain with compiled code, when everything else has been checked.
    ready(compiled_parts("arm", CompiledMap(ROBOT_ARM, np.zeros(0), np.zeros(0)), program.ops))
    compiled = robot_arm_map().compiled()
    world.put_arm(_evaluated(compiled, np.concatenate([start, stylus])[None])[0])
    device = simulated_phantom(port, Arm(pushes=pushes))
    servo = Servo(
        plant=make_plant(world),
        device=device,
        field=Field(
            units=law_units(program.ops), ops=program.ops, params=program.params, memory=program.fresh_memory(),
            limits=limiter.limits(), limiter=limiter.fresh_memory(), budget=tank.params(), tank=tank.fresh_memory(),
            wrench=np.zeros(6), force=np.zeros(3),
        ),
        reference=make_reference(world.arm, compiled, period * config.arm_ticks, config.smoothing),
        figure=robot_state(world, RATE),
        figure_ticks=config.arm_ticks,
        argument=device.hand[1:8],
    )  # fmt: skip
    return servo, world, curve


def arm_groups(servo: Servo) -> dict[str, Group]:
    """What a run records: ``ticks`` as every run, ``frames`` with joint angles [rad] and tool positions [m]."""
    every = groups(servo)
    ticks = {name: shape for name, shape in every["ticks"].channels.items() if name != "residual"}
    n = len(ARM_JOINTS)
    frames = {
        "t": (), "qpos": every["frames"].channels["qpos"], "reference": (n,), "joints": (n,), "tool": (3,),
        "led": (3,), "saturated": (),
    }  # fmt: skip
    return {"ticks": Group(every["ticks"].rate, ticks), "frames": Group(every["frames"].rate, frames)}


def record_arm(recorder: Recorder, servo: Servo, world: RobotWorld) -> Callable[[TickLog, FrameLog, int], None]:
    """An observer that appends every block to a recorder made with `arm_groups`."""
    first = int(world.model.joint(ROBOT + ARM_JOINTS[0]).qposadr[0])
    data = mujoco.MjData(world.arm)

    def tools(angles: Array) -> Array:
        places = np.empty((len(angles), 3))
        for i, q in enumerate(angles):
            data.qpos[:] = q
            mujoco.mj_kinematics(world.arm, data)
            places[i] = data.site(TOOL).xpos
        places[:, 2] += PEDESTAL
        return places

    def observe(ticks: TickLog, frames: FrameLog, n: int) -> None:
        channels = tick_channels(ticks, n)
        del channels["residual"]
        recorder.append("ticks", channels)
        m = -(-n // servo.figure_ticks)
        joints, reference = frames.qpos[:m, first : first + len(ARM_JOINTS)], frames.reference[:m]
        recorder.append(
            "frames",
            {
                "t": frames.t[:m], "qpos": frames.qpos[:m], "reference": reference, "joints": joints,
                "tool": tools(joints), "led": tools(reference), "saturated": frames.report[:m, REPORT_SATURATED],
            },
        )  # fmt: skip

    return observe


def run_arm(config: ArmConfig, out: Path, overwrite: bool) -> ArmSummary:
    """Run, and write recording, summary, figure and page into a folder.

    Raises
    ------
    ModelError, ControllerError, SimError
        If something about the configuration or the folder is wrong; the folder is then as it was.
    """
    console = Console(stderr=True)
    check_folder(out, overwrite)
    servo, world, curve = wire_arm(config, lambda parts: compile_once(console, config, parts))
    out.mkdir(parents=True, exist_ok=True)
    for name in (RECORDING, SUMMARY, REPORT, FIGURE):
        (out / name).unlink(missing_ok=True)
    static: dict[str, npt.ArrayLike | str] = {
        "curve": curve.point(np.linspace(curve.start, curve.end, 241)), "tube_radius": 0.02, "p_WH": P_WH,
        "motor_continuous": np.array(PREMIUM_1_5.continuous_torque),
    }  # fmt: skip
    with Recorder(out / RECORDING, asdict(config), config.seed, arm_groups(servo), static) as recorder:
        loop, first = Loop(servo, world, record_arm(recorder, servo, world)), servo.plant.period * config.arm_ticks
        loop.run(first)
        times = loop.run(config.seconds - first)
        recorder.flush()
        with Recording(out / RECORDING) as recording:
            summary = arm_summary(recording, world.arm, config, times.real_time_factor)
        recorder.close(asdict(summary) | {"lines": summary.lines()})
    (out / SUMMARY).write_text(json_text(asdict(summary)) + "\n", encoding="utf-8")
    with Recording(out / RECORDING) as recording:
        with mpl.rc_context(STYLE):
            arm_figure(recording).savefig(out / FIGURE, dpi=150)
        write_report(
            out / REPORT, recording, world.model, "FOLLOW leads a robot arm", summary.lines(), [out / FIGURE], _TARGET
        )
    for line in summary.lines():
        print(line)
    console.print(f"Written to {out}: {REPORT} (open it in a browser), {SUMMARY}, {RECORDING}.")
    return summary


def arm_summary(recording: Recording, arm: mujoco.MjModel, config: ArmConfig, speed: float) -> ArmSummary:
    """Measure a recording made with `arm_groups`."""
    t, distance, phase = (recording.channel("ticks", name)[:] for name in ("t", "distance", "phase"))
    work = np.linalg.norm(recording.channel("ticks", "user")[:], axis=1) > 1e-3
    last = np.maximum.accumulate(np.where(work, t, -np.inf))
    alone = (t >= 1.0) & (t - last > 1.0)
    steps = np.diff(phase)
    steps -= config.lap * np.round(steps / config.lap)
    settled = recording.channel("frames", "t")[:] >= 1.0
    tool, led, joints, reference = (
        recording.channel("frames", name)[:][settled] for name in ("tool", "led", "joints", "reference")
    )
    apart = 1e3 * np.linalg.norm(tool - led, axis=1)
    torque = np.abs(recording.channel("ticks", "ctrl")[:][:, -len(ARM_JOINTS) :])
    limits = arm_limits(arm)
    room = np.minimum(joints - limits[:, 0], limits[:, 1] - joints)
    return ArmSummary(
        laps=float(np.sum(steps)) / config.lap,
        deviation_rms_mm=1e3 * float(np.sqrt(np.mean(distance[alone] ** 2))) if alone.any() else float("nan"),
        tool_rms_mm=float(np.sqrt(np.mean(apart**2))),
        tool_max_mm=float(apart.max()),
        joints_rms_deg=float(np.degrees(np.sqrt(np.mean((joints - reference) ** 2)))),
        torque_share=float((torque / arm.actuator_ctrlrange[:, 1]).max()),
        nearest_limit_deg=float(np.degrees(room.min())),
        real_time_factor=speed,
    )


def arm_figure(recording: Recording) -> Figure:
    """Path of the tool against the curve that the stylus follows, and how far it is from where it is led."""
    t, tool, led = (recording.channel("frames", name)[:] for name in ("t", "tool", "led"))
    curve = HOME + [0.0, 0.0, PEDESTAL] + SCALE * recording.array("curve")
    ticks, user = recording.channel("ticks", "t")[:], recording.channel("ticks", "user")[:]
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    path, error = figure.subplots(1, 2, width_ratios=(1, 1.6))
    path.plot(1e3 * tool[:, 1], 1e3 * tool[:, 2], color=FIELD, label="tool")
    path.plot(1e3 * curve[:, 1], 1e3 * curve[:, 2], color=CURVE, ls=(0, (4, 3)), lw=0.8, label="curve, scaled")
    path.set(xlabel="y [mm]", ylabel="z [mm]", title="tool, from the front", aspect="equal")
    path.legend()
    error.plot(t, 1e3 * np.linalg.norm(tool - led, axis=1), color=FIELD, label="tool from where it is led [mm]")
    error.plot(ticks, np.linalg.norm(user, axis=1), color=USER, label="force of the hand [N]")
    error.set(xlabel="time [s]", ylim=(0.0, None), title="tracking")
    error.legend()
    return figure
