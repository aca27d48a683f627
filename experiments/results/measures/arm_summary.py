"""Measures of a run of the robot arm, from its recording, and in words."""

from dataclasses import dataclass

import mujoco
import numpy as np

from experiments.config.run_config import ArmConfig
from experiments.results.measures.oscillation import OscillationSummary, oscillation_summary
from models.robot_arm.spec import ARM_JOINTS, arm_limits
from sim.recording.recording import Recording


@dataclass(frozen=True)
class ArmSummary:
    """Measures of a run of the robot arm.

    Attributes
    ----------
    laps : float
    deviation_rms_mm : float
        RMS distance of the stylus from the curve; the first second, the pushes and a second after each are left out.
    tool_rms_mm, tool_max_mm : float
        Distance of the arm's end effector from where the stylus leads it; the first second is left out.
    joints_rms_deg : float
        RMS difference of the joint angles from h(p, R); the first second is left out.
    torque_share : float
        Largest ratio of a torque to the limit of its motor.
    nearest_limit_deg : float
        Least distance of a joint from its limit.
    real_time_factor : float
    oscillation : OscillationSummary
        Measured stability of the loop.
    """

    laps: float
    deviation_rms_mm: float
    tool_rms_mm: float
    tool_max_mm: float
    joints_rms_deg: float
    torque_share: float
    nearest_limit_deg: float
    real_time_factor: float
    oscillation: OscillationSummary

    def lines(self) -> list[str]:
        """Measures in words, one sentence per line."""
        return [
            *self.oscillation.lines(),
            f"The stylus ran {self.laps:.2f} laps, {self.deviation_rms_mm:.2f} mm RMS from the curve when left alone.",
            f"The tool was {self.tool_rms_mm:.2f} mm RMS, at most {self.tool_max_mm:.2f} mm, from where the stylus "
            f"leads it; the joints {self.joints_rms_deg:.3f}° RMS from h.",
            f"The motors gave at most {100 * self.torque_share:.0f} % of their torque, and no joint came nearer to its "
            f"limit than {self.nearest_limit_deg:.0f}°.",
            f"It ran at {self.real_time_factor:.2f} × real time.",
        ]


def arm_summary(recording: Recording, arm: mujoco.MjModel, config: ArmConfig, speed: float) -> ArmSummary:
    """Measure a recorded run of the arm."""
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
        oscillation=oscillation_summary(recording),
    )
