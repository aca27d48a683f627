"""Power that the executed law injects into a hand that shakes the stylus, against its bound."""

import numpy as np
import pytest

from controllers.certificates.loop.injected import BANDS, activity, injection
from controllers.certificates.loop.laws import FOLLOW_LAW
from controllers.certificates.loop.sampling import Sampling
from controllers.fields.algebra.program import evaluate
from controllers.fields.follow import Follow
from controllers.safety.energy_tank import river_power
from controllers.state import HandState
from tests.controllers.rivers_for_certificates import CIRCLE, DEVICE, river

PACE = 0.0477 * np.pi / 2.0


def injected(sampling, frequency, amplitude, direction, rounded=True, gains=(300.0, 8.0), periods=40):
    """Mean power [W] of the compiled law, sensed and held as the servo does it, and the hand's RMS speed [m/s]."""
    program, keep, period = Follow(CIRCLE, *gains, 0.25).program(), sampling.keep, sampling.period
    field, memory, wrench = program.compiled(), program.fresh_memory(), np.empty(6)
    ticks = max(round(periods / frequency / period), 200)
    position = lambda t: CIRCLE.point(1.0) + amplitude * np.sin(2.0 * np.pi * frequency * t) * direction  # noqa: E731
    step = np.array(DEVICE.encoder_step)
    theta_before, omega, work, square_speed, forces = None, np.zeros(3), 0.0, 0.0, []
    for k in range(ticks):
        theta = np.array(DEVICE.angles(position(k * period)))
        theta = step * np.round(theta / step) if rounded else theta
        omega = omega if theta_before is None else keep * omega + (1.0 - keep) * (theta - theta_before) / period
        theta_before = theta
        p, jacobian = DEVICE.numbers(theta)
        evaluate(*field, memory, HandState.at(p, jacobian @ omega, 0.0).vector(), wrench)
        forces.append(wrench[:3].copy())
        force = forces[max(0, len(forces) - 1 - sampling.whole_delay)]
        displacement = position((k + 1) * period) - position(k * period)
        if k > 20:
            # The work of a force held over a period depends on the displacement alone.
            work += float(force @ displacement)
            square_speed += 0.5 * (2.0 * np.pi * frequency * amplitude) ** 2 * period
    seconds = (ticks - 21) * period
    return work / seconds, np.sqrt(square_speed / seconds)


def bound(sampling, frequency, speed, gains=(300.0, 8.0)):
    """P̄ [W] for a vibration of RMS speed V [m/s], including the ideal bound."""
    executed = river(FOLLOW_LAW, *gains, sampling=sampling)
    band = next(i for i, f in enumerate(BANDS) if frequency <= f)
    found = injection(executed, executed.still())
    return river_power(gains[1], PACE) + found.activity[band] * speed**2 + found.rounding * speed


RADIAL = CIRCLE.point(1.0) / np.linalg.norm(CIRCLE.point(1.0))
TANGENT = CIRCLE.velocity(1.0) / PACE


def test_fast_shaking_injects_at_least_half_of_the_bound_and_fifty_times_the_ideal_power():
    power, speed = injected(Sampling(1e-3), 300.0, 5e-4, RADIAL)
    assert power > 50.0 * river_power(8.0, PACE)
    assert 0.5 * bound(Sampling(1e-3), 300.0, speed) < power < bound(Sampling(1e-3), 300.0, speed)


@pytest.mark.parametrize("delay", [0.0, 1e-3])
@pytest.mark.parametrize("direction", [RADIAL, TANGENT, np.array([0.0, 0.0, 1.0])])
def test_sinusoidal_hand_motion_injects_less_than_the_bound(direction, delay):
    rng, sampling = np.random.default_rng(3), Sampling(1e-3, delay)
    for frequency in (2.0, 7.3, 21.0, 67.0, 140.0, 211.0, 290.0):
        amplitude = float(10.0 ** rng.uniform(-4.5, -3.0)) * min(1.0, 60.0 / frequency)
        # Four periods of a slow oscillation have as many ticks as fifteen of a fast one.
        periods = 4 if frequency < 10.0 else 15
        power, speed = injected(sampling, frequency, amplitude, direction, periods=periods)
        assert power < bound(sampling, frequency, speed), (frequency, amplitude)


def test_activity_matches_power_of_the_sampled_loop():
    for frequency in (40.0, 130.0, 260.0):
        power, speed = injected(Sampling(1e-3), frequency, 2e-4, RADIAL, rounded=False, periods=100)
        expected = float(activity(300.0, 8.0, Sampling(1e-3), np.array([frequency]))[0]) * speed**2
        assert power == pytest.approx(expected, rel=0.03, abs=0.02 * abs(expected))


def test_slow_motion_has_no_activity_beyond_the_ideal_law():
    found = injection(river(), river().still())
    assert found.activity[0] == 0.0
    assert 30.0 < found.passive_below < 300.0
    assert activity(300.0, 8.0, Sampling(1e-6, cutoff=1e5), np.array([1.0]))[0] == pytest.approx(-8.0, rel=1e-3)
