"""Search for counterexamples of switching: hands that crossing rivers lose, or chatter, on the linearised device.

The device is linearised about one place, with its kinematics, inertia and weight there; the zero-order hold is exact;
encoder quantisation and velocity filter are those of the servo. Coulomb friction is the torque that would stop a joint
within the period, at most f_c. The law is the executed kernel.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.device import Device
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.fields.algebra.instructions import TRACE_RIVER
from controllers.fields.algebra.program import evaluate
from controllers.fields.higher_order import HigherOrder
from controllers.state import HandState
from geometry.arrays import Array

LOSS_TIME = 0.02  # [s] without an active river after which a hand counts as thrown out
APPROACH_TIME, SEARCH_TIME = 0.6, 1.3  # [s] from the start of a hand to where rivers meet, and of its simulation
MIN_CHATTER_CHANGES = 3  # changes of river within `LOSS_TIME` that count as chattering


class Push(NamedTuple):
    """A constant force of the hand.

    Attributes
    ----------
    force : tuple of float
        Force in H [N].
    start, duration : float
        Start and duration [s].
    """

    force: tuple[float, float, float]
    start: float
    duration: float


class Course(NamedTuple):
    """Simulated course of a hand, tick by tick.

    Attributes
    ----------
    p : Array, shape (n, 3)
        Position in H [m].
    river : Array, shape (n,)
        Number of the active river, −1 for none.
    """

    p: Array
    river: Array


class Failure(NamedTuple):
    """Failure of a field to keep a hand.

    Attributes
    ----------
    kind : str
        ``"chatters"``, ``"thrown out"`` or ``"taken over"``.
    time : float
        Time of the failure [s].
    """

    kind: str
    time: float


def course(field: HigherOrder, loop: SampledLoop, place: Array, start: Array, velocity: Array, seconds: float,
           device: Device, push: Push | None = None) -> Course:  # fmt: skip
    """Simulate a hand in the field, on a device linearised about a place.

    Parameters
    ----------
    field : HigherOrder
        The rivers.
    loop : SampledLoop
        Loop of the device at `place`, its only phase; without delay.
    place, start, velocity : Array, shape (3,)
        Place of the linearisation, initial position [m] and initial velocity [m/s].
    seconds : float
        Duration [s].
    device : Device
        Device with its friction and encoders.
    push : Push, optional
        Push of the hand.
    """
    linear, sampling = loop.linear, loop.sampling
    free, driven = (response[0] for response in loop.plant(sampling.period))
    jacobian, n = linear.jacobian[0], round(seconds / sampling.period)
    program, step = field.program(), np.array(device.encoder_step)
    memory, wrench = program.fresh_memory(), np.zeros(6)
    x = np.concatenate([np.linalg.solve(jacobian, start - place), np.linalg.solve(jacobian, velocity)])
    previous, rate = _quantise(x[:3], linear.theta[0], step), x[3:].copy()
    points, river = np.zeros((n, 3)), np.zeros(n)
    for k in range(n):
        measured = _quantise(x[:3], linear.theta[0], step)
        rate = sampling.keep * rate + (1.0 - sampling.keep) * (measured - previous) / sampling.period
        previous = measured
        points[k] = place + jacobian @ x[:3]
        hand = HandState.at(place + jacobian @ measured, jacobian @ rate, k * sampling.period)
        evaluate(*program.compiled(), memory, hand.vector(), wrench)
        river[k] = memory[TRACE_RIVER]
        force = wrench[:3].copy()
        if push is not None and push.start <= k * sampling.period < push.start + push.duration:
            force += push.force
        torque = jacobian.T @ force
        stopping = linear.mass[0] @ x[3:] / sampling.period + torque
        torque -= np.clip(stopping, -np.array(device.coulomb), np.array(device.coulomb))
        x = free @ x + driven @ (torque + linear.weight_theta[0] @ measured)
    return Course(points, river)


def _quantise(x: Array, theta: Array, step: Array) -> Array:
    return np.asarray(step * np.rint((theta + x) / step) - theta, dtype=np.float64)


def failure(river: Array, period: float, own: int, pushed: bool, smooth: bool = False) -> Failure | None:
    """First failure of river `own` to keep its hand, or None; only a hand that it once had can be taken over.

    Parameters
    ----------
    river : Array, shape (n,)
        Active river at each tick, −1 for none.
    period : float
        Servo period [s].
    own : int
        Number of the river that should keep the hand.
    pushed : bool
        Whether the hand pushes: then it may be taken over by another river.
    smooth : bool
        Whether the form is smooth, with a force that does not jump: then only the last river and a loss count.
    """
    window = max(MIN_CHATTER_CHANGES + 1, round(LOSS_TIME / period))
    owned = np.logical_or.accumulate(river == own)
    changed = np.concatenate([[0.0], np.cumsum(np.diff(river) != 0.0)])
    lost = np.concatenate([[0.0], np.cumsum(river < 0.0)])
    for k in range(len(river)):
        first = max(0, k - window)
        if not smooth and changed[k] - changed[first] >= MIN_CHATTER_CHANGES:
            return Failure("chatters", k * period)
        if k >= window and lost[k + 1] - lost[k + 1 - window] >= window:
            return Failure("thrown out", k * period)
        if not pushed and owned[k] and river[k] >= 0.0 and river[k] != own and (not smooth or k == len(river) - 1):
            return Failure("taken over", k * period)
    return None


Simulation = Callable[[Array, Array, float, Push], Course]
"""Simulation of a hand on a more complete model of the device: from p [m] and v [m/s], for a time [s], with a push."""


def counterexample(
    field: HigherOrder,
    own: int,
    river: CertifiedRiver,
    phase: float,
    towards: Array,
    pushes: Iterable[float],
    simulate: Simulation,
) -> dict[str, object]:
    """First hand that the field fails to keep, confirmed by a simulation: initial state, force and times.

    The hands tried start on the river 0.6 s before the phase, at rest, or at the river's pace if a hand at rest would
    belong to another river. They are pushed towards the other river, away from it, along the river and against it, for
    0.2 s shortly before the phase. One more hand starts at the phase with the rivers' mean velocity.

    Parameters
    ----------
    field : HigherOrder
        The rivers.
    own : int
        Number of the river among them.
    river : CertifiedRiver
        The same river in the form that is certified.
    phase : float
        Phase at which another river meets it [s].
    towards : Array, shape (3,)
        φ̇_j of the other river there [m/s].
    pushes : iterable of float
        Forces [N], tried in this order.
    simulate : callable
        Simulation that confirms a failure; a failure that it does not reproduce is no counterexample.

    Returns
    -------
    dict
        The counterexample; empty if there is none.
    """
    curve, period, smooth = river.curve, river.sampling.period, field.form == "smooth"
    before = phase - APPROACH_TIME if curve.periodic else max(phase - APPROACH_TIME, curve.start + 1e-3)
    at = int(np.argmin(np.abs(river.phases() - phase)))
    loop, here, start = _at_phase(river.loop(), at), curve.point(river.phases()[at]), curve.point(before)
    rest = np.zeros(3)
    first = course(field, loop, here, start, rest, period, river.device).river[0]
    approach = start, rest if first in (-1.0, own) else curve.velocity(before)
    meeting = None if smooth else (curve.point(phase), 0.5 * (curve.velocity(phase) + towards))
    for p, v, push, pushed in _hands(approach, meeting, curve.velocity(phase), towards, pushes):
        searched = course(field, loop, here, p, v, SEARCH_TIME, river.device, push)
        found = failure(searched.river, period, own, pushed, smooth)
        if found is None:
            continue
        confirmed = failure(simulate(p, v, SEARCH_TIME, push).river, period, own, pushed, smooth)
        if confirmed is not None and confirmed.kind == found.kind:
            return {
                "kind": found.kind, "time": found.time, "simulated_time": confirmed.time,
                "force": [float(f) for f in push.force], "push_start": push.start,
                "push_duration": push.duration, "river": own, "p": p, "v": v,
            }  # fmt: skip
    return {}


def _hands(
    approach: tuple[Array, Array], meeting: tuple[Array, Array] | None, along: Array, towards: Array,
    pushes: Iterable[float],
) -> Iterator[tuple[Array, Array, Push, bool]]:  # fmt: skip
    """Hands that `counterexample` tries: p and v at the start, the push, and whether another river may take it.

    `approach` and `meeting` are p and v on the river before the phase, and at it, where no hand starts without one.
    """
    ahead = along / np.linalg.norm(along)
    aside = towards - ahead * (ahead @ towards)
    aside = aside / max(float(np.linalg.norm(aside)), 1e-12)
    for newtons in pushes:
        for direction in [0.0 * ahead] if newtons == 0.0 else [aside, -aside, ahead, -ahead]:
            push = Push(tuple((newtons * direction).tolist()), APPROACH_TIME - 0.15, 0.2)
            yield *approach, push, newtons > 0.0
        if newtons == 0.0 and meeting is not None:
            yield *meeting, Push((0.0, 0.0, 0.0), APPROACH_TIME - 0.15, 0.2), True


def _at_phase(loop: SampledLoop, at: int) -> SampledLoop:
    """The loop restricted to one of its phases."""
    linear, selection = loop.linear, slice(at, at + 1)
    restricted = {
        name: getattr(linear, name)[selection]
        for name in ("phases", "theta", "rate", "jacobian", "mass", "inverse_theta", "inverse_rate", "weight_theta",
                     "velocity", "shift")
    }  # fmt: skip
    restricted |= {name: getattr(linear, name)[:, selection] for name in ("unit_theta", "unit_omega")}
    return SampledLoop(replace(linear, **restricted), loop.sampling)
