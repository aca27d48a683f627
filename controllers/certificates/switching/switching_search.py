"""Search for a hand that a field of crossing rivers loses or lets chatter: the executed law on the linearised device.

The device stands at one place: kinematics, inertia and weight are those there, the hold is exact, the encoders round
and the velocity is filtered as in the servo; Coulomb friction is the torque that would stop a joint within the period,
at most f_c. The law is the kernel that runs.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.device import Device
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import River
from controllers.fields.higher_order import HigherOrder
from controllers.fields.instructions import TRACE_RIVER
from controllers.fields.program import evaluate
from controllers.state import Array, HandState

LOST = 0.02  # [s] without a river from which on a hand counts as thrown out
EARLIER, SECONDS = 0.6, 1.3  # [s] before the meeting a hand begins, and how long it is watched
CHANGES = 3  # of river within `LOST` that count as chattering


class Push(NamedTuple):
    """A constant force of the hand.

    Attributes
    ----------
    force : tuple of float
        In H [N].
    start, duration : float
        [s].
    """

    force: tuple[float, float, float]
    start: float
    duration: float


class Course(NamedTuple):
    """Where a hand went, tick by tick.

    Attributes
    ----------
    p : Array, shape (n, 3)
        In H [m].
    river : Array, shape (n,)
        Which one had it, −1 for none.
    """

    p: Array
    river: Array


class Failure(NamedTuple):
    """What became of a hand.

    Attributes
    ----------
    kind : str
        ``"chatters"``, ``"thrown out"`` or ``"taken over"``.
    time : float
        When [s].
    """

    kind: str
    time: float


def course(field: HigherOrder, loop: SampledLoop, place: Array, start: Array, velocity: Array, seconds: float,
           device: Device, push: Push | None = None) -> Course:  # fmt: skip
    """Let a hand go in the field, on a device that is linear about a place.

    Parameters
    ----------
    field : HigherOrder
        The rivers.
    loop : SampledLoop
        Of the device at `place`, its only phase; without delay.
    place, start, velocity : Array, shape (3,)
        p of the linearisation, and p and v at the beginning [m], [m/s].
    seconds : float
        How long [s].
    device : Device
        Its friction and its encoders.
    push : Push, optional
        Of the hand.
    """
    linear, sampling = loop.linear, loop.sampling
    free, driven = (response[0] for response in loop.plant(sampling.period))
    jacobian, n = linear.jacobian[0], round(seconds / sampling.period)
    program, step = field.program(), np.array(device.encoder_step)
    memory, wrench = program.fresh_memory(), np.zeros(6)
    x = np.concatenate([np.linalg.solve(jacobian, start - place), np.linalg.solve(jacobian, velocity)])
    last, rate = _rounded(x[:3], linear.theta[0], step), x[3:].copy()
    points, river = np.zeros((n, 3)), np.zeros(n)
    for k in range(n):
        read = _rounded(x[:3], linear.theta[0], step)
        rate = sampling.keep * rate + (1.0 - sampling.keep) * (read - last) / sampling.period
        last = read
        points[k] = place + jacobian @ x[:3]
        hand = HandState.at(place + jacobian @ read, jacobian @ rate, k * sampling.period)
        evaluate(*program.compiled(), memory, hand.vector(), wrench)
        river[k] = memory[TRACE_RIVER]
        force = wrench[:3].copy()
        if push is not None and push.start <= k * sampling.period < push.start + push.duration:
            force += push.force
        torque = jacobian.T @ force
        stopping = linear.mass[0] @ x[3:] / sampling.period + torque
        torque -= np.clip(stopping, -np.array(device.coulomb), np.array(device.coulomb))
        x = free @ x + driven @ (torque + linear.weight_theta[0] @ read)
    return Course(points, river)


def _rounded(x: Array, theta: Array, step: Array) -> Array:
    return np.asarray(step * np.rint((theta + x) / step) - theta, dtype=np.float64)


def failure(river: Array, period: float, own: int, pushed: bool, smooth: bool = False) -> Failure | None:
    """What went wrong with the hand of river `own`, if anything did; one that it never had is not taken over.

    Parameters
    ----------
    river : Array, shape (n,)
        Which one had it at each tick, −1 for none.
    period : float
        Of a tick [s].
    own : int
        Whose hand it is.
    pushed : bool
        Whether somebody pushes: then it may go over to another river, once.
    smooth : bool
        Of the smooth form, whose force does not jump: only where the hand is in the end counts, and being lost.
    """
    window = max(CHANGES + 1, round(LOST / period))
    had = np.logical_or.accumulate(river == own)
    changed = np.concatenate([[0.0], np.cumsum(np.diff(river) != 0.0)])
    lost = np.concatenate([[0.0], np.cumsum(river < 0.0)])
    for k in range(len(river)):
        first = max(0, k - window)
        if not smooth and changed[k] - changed[first] >= CHANGES:
            return Failure("chatters", k * period)
        if k >= window and lost[k + 1] - lost[k + 1 - window] >= window:
            return Failure("thrown out", k * period)
        if not pushed and had[k] and river[k] >= 0.0 and river[k] != own and (not smooth or k == len(river) - 1):
            return Failure("taken over", k * period)
    return None


Simulation = Callable[[Array, Array, float, Push], Course]
"""A hand let go on a fuller model of the device, from p [m] and v [m/s], for some time [s], with a push."""


def counterexample(
    field: HigherOrder,
    own: int,
    river: River,
    phase: float,
    towards: Array,
    pushes: Iterable[float],
    simulate: Simulation,
) -> dict[str, object]:
    """First hand found that the field loses, and loses alike in a simulation: initial state, force and times.

    Tried are hands that begin on the river 0.6 s before a phase, at rest, or at its pace where a hand at rest is
    another river's, and are pushed towards the other river, away from it, along and against, for 0.2 s shortly before;
    and one that begins at the phase with the rivers' mean velocity.

    Parameters
    ----------
    field : HigherOrder
        The rivers.
    own : int
        Number of the river among them.
    river : River
        The same one as it is certified.
    phase : float
        Where another one meets it [s].
    towards : Array, shape (3,)
        φ̇_j of the other one there [m/s].
    pushes : iterable of float
        Forces [N], tried in this order.
    simulate : callable
        The judge: what the linear device loses and this one keeps, or loses in another way, is no counterexample.

    Returns
    -------
    dict
        Empty if there is none.
    """
    place, along = river.curve.point(phase), river.curve.velocity(phase)
    before = max(phase - EARLIER, river.curve.start + 1e-3) if not river.curve.periodic else phase - EARLIER
    linear = river.still()
    at = int(np.argmin(np.abs(river.phases() - phase)))
    loop = _at(SampledLoop(linear, river.sampling), at)
    here = river.curve.point(river.phases()[at])
    ahead = along / np.linalg.norm(along)
    aside = towards - ahead * (ahead @ towards)
    aside = aside / max(float(np.linalg.norm(aside)), 1e-12)
    smooth = field.form == "smooth"
    for newtons in pushes:
        ways = [0.0 * ahead] if newtons == 0.0 else [aside, -aside, ahead, -ahead]
        starts = [(river.curve.point(before), 0.0 * ahead)]
        if newtons == 0.0 and not smooth:
            starts.append((place, 0.5 * (along + towards)))
        for start, velocity in starts:
            for way in ways:
                push = Push(tuple((newtons * way).tolist()), EARLIER - 0.15, 0.2)
                led = start is place
                went = course(field, loop, here, start, velocity, SECONDS, river.device, push)
                if not led and went.river[0] not in (-1.0, own):
                    velocity = river.curve.velocity(before)
                    went = course(field, loop, here, start, velocity, SECONDS, river.device, push)
                ended = failure(went.river, river.sampling.period, own, newtons > 0.0 or led, smooth)
                if ended is None:
                    continue
                again = simulate(start, velocity, SECONDS, push)
                judged = failure(again.river, river.sampling.period, own, newtons > 0.0 or led, smooth)
                if judged is not None and judged.kind == ended.kind:
                    return {
                        "kind": ended.kind, "time": ended.time, "simulated_time": judged.time,
                        "force": [float(f) for f in push.force], "push_start": push.start,
                        "push_duration": push.duration, "river": own, "p": start, "v": velocity,
                    }  # fmt: skip
    return {}


def _at(loop: SampledLoop, at: int) -> SampledLoop:
    """The loop at one of its phases alone."""
    linear, one = loop.linear, slice(at, at + 1)
    cut = {
        name: getattr(linear, name)[one]
        for name in ("phases", "theta", "rate", "jacobian", "mass", "inverse_theta", "inverse_rate", "weight_theta",
                     "velocity", "shift")
    }  # fmt: skip
    cut |= {name: getattr(linear, name)[:, one] for name in ("unit_theta", "unit_omega")}
    return SampledLoop(replace(linear, **cut), loop.sampling)
