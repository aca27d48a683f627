"""The simulated hand: the impedance of an arm on the stylus, from position and velocity alone, never the field."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.easing import smooth_step, smooth_step_slope
from models.phantom.parameters import MIN_TIP_MASS, PREMIUM_1_5
from sim.errors import SimError
from sim.users.hand.actions import Grab, Push, Records, Turn, grab_table, push_table, turn_table

_STYLUS_INERTIA = min(PREMIUM_1_5.gimbal_inertia)  # [kg m²]


@njit
def push_force(pushes: Records, begun: Array, t: float, p: Array, force: Array) -> None:
    """Add the pushes active at time t to a force.

    Parameters
    ----------
    pushes : Records
        A `sim.users.hand.actions.push_table` of n pushes.
    begun : Array
        When each push began [s], NaN if it has not; shape (n,), updated.
    t : float
        Time [s].
    p : Array
        Hand position in H [m], shape (3,).
    force : Array
        Added to [N], in H, shape (3,).
    """
    for i in range(pushes.shape[0]):
        push = pushes[i]
        if math.isnan(begun[i]):
            x, y, z = p[0] - push.place[0], p[1] - push.place[1], p[2] - push.place[2]
            distance = math.sqrt(x**2 + y**2 + z**2)
            if t < push.start or (push.radius > 0.0 and distance > push.radius):
                continue
            begun[i] = t if push.radius > 0.0 else push.start
        phase = (t - begun[i]) / push.duration
        if phase > 1.0:
            continue
        bump = push.peak * math.sin(math.pi * phase) ** 2
        if push.outward == 0.0:
            for k in range(3):
                force[k] += bump * push.direction[k]
        else:
            radius = math.sqrt(p[0] ** 2 + p[1] ** 2)
            if radius > 1e-9:
                force[0] += bump * p[0] / radius
                force[1] += bump * p[1] / radius


@njit
def arm_force(
    stiffness: float, damping: float, samples: Array, period: float, t: float, p: Array, v: Array, force: Array
) -> None:
    """Set the force of an arm that tracks its own intended path: F = k (p_d − p) + b (ṗ_d − v).

    Parameters
    ----------
    stiffness, damping : float
        k [N/m], b [N s/m].
    samples : Array
        The intended path in H, sampled every `period`, shape (n, 3); n = 0: no grip, no force. The path ends at rest in
        its last sample.
    period : float
        Sampling period [s].
    t, p, v, force
        Time [s], hand position [m], velocity [m/s] and result [N], in H.
    """
    force[:] = 0.0
    n = samples.shape[0]
    if n == 0:
        return
    position = t / period
    i = min(int(position), n - 1)
    j = min(i + 1, n - 1)
    s = position - i if j > i else 0.0
    for k in range(3):
        target = samples[i, k] + s * (samples[j, k] - samples[i, k])
        speed = (samples[j, k] - samples[i, k]) / period
        force[k] = stiffness * (target - p[k]) + damping * (speed - v[k])


@njit
def grab_force(
    stiffness: float, damping: float, grabs: Records, held: Array, t: float, p: Array, v: Array, force: Array
) -> float:
    """Add the force of an arm in a grab at time t, k (p_d − p) + b (ṗ_d − v), and return the switch.

    The motion to the place and the carrying have the minimum-jerk profile σ(s) = 10 s³ − 15 s⁴ + 6 s⁵.

    Parameters
    ----------
    stiffness, damping : float
        k [N/m], b [N s/m].
    grabs : Records
        A `sim.users.hand.actions.grab_table` of n grabs.
    held : Array
        Position of the hand when each grab began [m], NaN if it has not; shape (n, 3), updated.
    t, p, v, force
        Time [s], hand position [m], velocity [m/s], and the force that is added to [N], in H.

    Returns
    -------
    float
        1 while the switch is pressed, else 0.
    """
    for i in range(grabs.shape[0]):
        grab = grabs[i]
        pressed_at = grab.start + grab.reach
        if not grab.start <= t < pressed_at + grab.duration + grab.hold:
            continue
        if math.isnan(held[i, 0]):
            held[i] = p
        approach, approach_slope = 1.0, 0.0
        if grab.reach > 0.0:
            approach_phase = (t - grab.start) / grab.reach
            approach, approach_slope = smooth_step(approach_phase), smooth_step_slope(approach_phase)
        carry_phase = (t - pressed_at) / grab.duration
        carried, carried_slope = smooth_step(carry_phase), smooth_step_slope(carry_phase)
        if grab.steady != 0.0:
            carried, carried_slope = min(max(carry_phase, 0.0), 1.0), 1.0 if 0.0 <= carry_phase < 1.0 else 0.0
        for k in range(3):
            displacement = 0.0 if math.isnan(grab.place[0]) else grab.place[k] - held[i, k]
            target = held[i, k] + approach * displacement + carried * grab.carry[k]
            speed = carried_slope * grab.carry[k] / grab.duration
            if approach_slope > 0.0:
                speed += approach_slope * displacement / grab.reach
            force[k] += stiffness * (target - p[k]) + damping * (speed - v[k])
        return 1.0 if t >= pressed_at else 0.0
    return 0.0


class CompiledArm(NamedTuple):
    """An `Arm` as plain numbers and arrays.

    Its state is `push_start_times`, the start time of each push; `held`, the hand's position when each grab began;
    `switch` (1,).
    """

    stiffness: float
    damping: float
    path: Array
    period: float
    pushes: Records
    push_start_times: Array
    grabs: Records
    held: Array
    switch: Array
    turn_stiffness: float
    turn_damping: float
    turns: Records


@njit
def hand_force(arm: CompiledArm, t: float, p: Array, v: Array, force: Array) -> None:
    """Set the force of the hand on the stylus, in H: arm impedance plus pushes and grabs; and the switch."""
    if arm.path.shape[0] + arm.pushes.shape[0] + arm.grabs.shape[0] == 0:
        force[0], force[1], force[2] = 0.0, 0.0, 0.0
    else:
        arm_force(arm.stiffness, arm.damping, arm.path, arm.period, t, p, v, force)
        push_force(arm.pushes, arm.push_start_times, t, p, force)
        arm.switch[0] = grab_force(arm.stiffness, arm.damping, arm.grabs, arm.held, t, p, v, force)


@dataclass(frozen=True)
class Arm:
    """A simple user: an arm that is relaxed or tracks a path of its own, with pushes, grabs and turns of the stylus.

    Parameters
    ----------
    stiffness, damping : float
        Impedance of the arm about its intended path or that of a grab [N/m], [N s/m]; unused without either.
    path : Array
        Intended positions in H [m], shape (n, 3), `period` apart; empty for a relaxed hand.
    period : float
        Sampling period of the path [s].
    pushes : sequence of Push
        Additional forces of the hand.
    grabs : sequence of Grab
        When and where the hand grabs, one after the other; only for an arm without a path.
    turns : sequence of Turn
        Rotations of the stylus. If there are any, the hand holds the stylus upright in between; if there are none, the
        gimbal swings freely.
    turn_stiffness, turn_damping : float
        Impedance of the fingers about the intended orientation [N m/rad], [N m s/rad]; unused without turns. The
        defaults damp the stylus about critically.

    Raises
    ------
    SimError
        If an impedance is negative or not finite, the path is not an (n, 3) array of finite numbers or its period not
        positive, there are both a path and grabs, or grabs overlap.
    """

    stiffness: float = 300.0
    damping: float = 5.0
    path: Array = field(default_factory=lambda: np.zeros((0, 3)))
    period: float = 1e-3
    pushes: Sequence[Push] = ()
    grabs: Sequence[Grab] = ()
    turns: Sequence[Turn] = ()
    turn_stiffness: float = 0.1
    turn_damping: float = 2.5e-3
    wishes: ClassVar[None] = None
    """None: an arm does not look at the figure."""

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "turn_stiffness", "turn_damping"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise SimError(f"the arm's {name} is {value}; it must be finite and not negative")
        if not (math.isfinite(self.period) and self.period > 0.0):
            raise SimError(f"the period of the arm's path is {self.period} s; it must be positive")
        if self.path.ndim != 2 or self.path.shape[1] != 3 or not np.all(np.isfinite(self.path)):
            raise SimError(f"the arm's path has shape {self.path.shape}; expected (n, 3), all finite")
        if len(self.path) > 0 and len(self.grabs) > 0:
            raise SimError(f"an arm that traces a path cannot grab as well; got {len(self.grabs)} grabs")
        grab_table(self.grabs)

    def holding(self, period: float, physics_step: float) -> "Arm":
        """The arm itself, for a servo period and a physics step [s]; see `check_step`."""
        self.check_step(physics_step)
        return self

    def check_step(self, physics_step: float) -> None:
        """Check that no impedance of this arm, whose force is held for a step, is too stiff for a physics step.

        A spring k and a damper b on a mass m, stepped by semi-implicit Euler with a step h, are stable for
        k h² + 2 b h < 4 m: h < 2 (√(b² + 4 k m) − b)/k, with the smallest apparent mass of the tip or the
        smallest inertia of the stylus.

        Raises
        ------
        SimError
            If the step is too long.
        """
        springs: list[tuple[str, float, float, float]] = []
        if self.turns:
            springs.append(("hand that turns the stylus", self.turn_stiffness, self.turn_damping, _STYLUS_INERTIA))
        if len(self.path) > 0 or self.grabs:
            springs.append(("arm", self.stiffness, self.damping, MIN_TIP_MASS))
        for holder, k, b, m in springs:
            max_step = 4.0 * m / (b + math.sqrt(b * b + 4.0 * k * m)) if k + b > 0.0 else math.inf
            if physics_step > max_step:
                raise SimError(
                    f"the {holder} needs a physics step of {math.floor(1e5 * max_step) / 1e5:g} s or less, got "
                    f"{physics_step:g} s; choose a smaller --physics-step"
                )

    def compiled(self) -> CompiledArm:
        """The arm as arrays for the servo loop."""
        return CompiledArm(self.stiffness, self.damping, np.ascontiguousarray(self.path), self.period,
                           push_table(self.pushes), np.full(len(self.pushes), np.nan),
                           grab_table(self.grabs), np.full((len(self.grabs), 3), np.nan), np.zeros(1),
                           self.turn_stiffness, self.turn_damping, turn_table(self.turns))  # fmt: skip
