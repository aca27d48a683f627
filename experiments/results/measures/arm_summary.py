"""Measures of a robot arm in a run, from its recording, and in words."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import rms
from models.robot_arm.spec import ARM_JOINTS, arm_limits, arm_model
from sim.recording.recording import Recording

_START_TIME = 1.0  # [s] in which the arm, initially at rest, catches up with the hand


@dataclass(frozen=True)
class ArmSummary:
    """Measures of a robot arm; those of tracking leave out the first second.

    Attributes
    ----------
    tool_rms_mm, tool_max_mm : float
        Distance of the arm's end effector from where the stylus leads it.
    joints_rms_deg : float
        RMS difference of the joint angles from h(p, R).
    torque_share : float
        Largest ratio of a torque to the limit of its motor.
    nearest_limit_deg : float
        Least distance of a joint from its limit.
    """

    tool_rms_mm: float
    tool_max_mm: float
    joints_rms_deg: float
    torque_share: float
    nearest_limit_deg: float

    def lines(self) -> list[str]:
        """Measures in words, one sentence per line."""
        return [
            f"The tool was {self.tool_rms_mm:.2f} mm RMS, at most {self.tool_max_mm:.2f} mm, from where the stylus "
            f"leads it; the joints {self.joints_rms_deg:.3f}° RMS from h.",
            f"The motors gave at most {100 * self.torque_share:.0f} % of their torque, and no joint came nearer to its "
            f"limit than {self.nearest_limit_deg:.0f}°.",
        ]


def arm_summary(recording: Recording) -> ArmSummary:
    """Measure the robot arm of a recorded run."""
    arm, t = arm_model(), recording.channel("frames", "t")[:]
    settled = t >= min(_START_TIME, t[-1])
    tool, led, joints, reference = (
        recording.channel("frames", name)[:][settled] for name in ("tool", "led", "joints", "reference")
    )
    apart = 1e3 * np.linalg.norm(tool - led, axis=1)
    torque = np.abs(recording.channel("ticks", "ctrl")[:][:, -len(ARM_JOINTS) :])
    limits = arm_limits(arm)
    room = np.minimum(joints - limits[:, 0], limits[:, 1] - joints)
    return ArmSummary(
        tool_rms_mm=rms(apart),
        tool_max_mm=float(apart.max()),
        joints_rms_deg=float(np.degrees(rms(joints - reference))),
        torque_share=float((torque / arm.actuator_ctrlrange[:, 1]).max()),
        nearest_limit_deg=float(np.degrees(room.min())),
    )
