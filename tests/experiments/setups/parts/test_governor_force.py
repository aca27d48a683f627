"""Governor and gate on the simulated Phantom: a hand too slow for a flight meets a force, and is not admitted."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.fields.governor import Governor
from experiments.config.options import run_config
from experiments.flights.ballistics import clip_ballistics
from experiments.setups.parts.clips import load_clips
from experiments.setups.parts.governor import animation_along
from experiments.setups.parts.lap import DEFAULT_LAP
from experiments.setups.wiring import wire
from experiments.studies.rate_trials import DRAG, LedBackflip
from models.mocap.library import embedded


@pytest.fixture(scope="module")
def backflip():
    return LedBackflip()


@pytest.mark.slow
def test_admissible_speeds_come_from_the_flight_of_the_clip(backflip):
    """By the clip's certificate, not by the map: σ |φ̇| in its flight, at the phases at which it flies."""
    clip = embedded("backflip")
    (flight,) = clip_ballistics(clip).flights
    pace = backflip.curve.length / clip.duration
    flying = backflip.speeds[:, 0] > 0.0
    np.testing.assert_allclose(backflip.speeds[flying], np.tile(pace * np.array(flight.admissible), (flying.sum(), 1)),
                               rtol=5e-3)  # fmt: skip
    first, last = (share / backflip.curve.duration * clip.duration for share in backflip.flight)
    assert first == pytest.approx(flight.fit.time, abs=0.02)
    assert last == pytest.approx(flight.fit.time + flight.fit.duration, abs=0.02)


def test_gate_admits_only_hands_at_speed(backflip):
    least = backflip.speeds[:, 0].max()
    slow, slow_share = backflip.taken_at(0.3 * least)
    right, right_share = backflip.taken_at(1.05 * least)
    assert slow == pytest.approx(0.3 * least, rel=0.1)
    assert slow_share == 0.0
    assert right == pytest.approx(1.05 * least, rel=0.15)
    assert right_share > 0.9


def test_hand_that_slows_down_in_flight_meets_a_force(backflip):
    passage = backflip.passage(backflip.governor(), backflip.slowing_path(0.05))
    first, last = backflip.flight
    least = backflip.speeds[:, 0].max()
    before = (passage.phase > first - 0.2) & (passage.phase < first - 0.05)
    slow = (passage.phase > last - 0.15) & (passage.phase < last - 0.05)
    assert np.abs(passage.along[before]).max() < 0.01
    assert passage.speed[slow].mean() < 0.7 * least
    np.testing.assert_allclose(passage.along[slow], DRAG * (least - passage.speed[slow]), atol=0.05)
    assert passage.along[slow].min() > 0.2


@pytest.mark.slow
def test_governor_speeds_follow_the_animation_of_the_run():
    config = run_config(clips=("backflip",), governor=True, seconds=1.0)
    session = wire(config)
    maps = session.parts.maps
    (governor,) = (law for law in session.field.program().laws if isinstance(law, Governor))
    # At the clips' own pace, not at that of the lap or of the friction-compensated curve.
    pace, shares = maps.curve.length / maps.lap_seconds, np.linspace(0.0, 1.0, len(governor.speeds))
    assert maps.lap_seconds != pytest.approx(DEFAULT_LAP, rel=0.1)
    assert session.curve.duration < 0.95 * DEFAULT_LAP
    (flight,) = clip_ballistics(embedded("backflip")).flights
    flying = governor.speeds[:, 0] > 0.0
    np.testing.assert_allclose(governor.speeds[flying], np.tile(pace * np.array(flight.admissible), (flying.sum(), 1)),
                               rtol=5e-3)  # fmt: skip
    # Each flight of the lap begins at the position of the stylus at that time.
    begins = session.curve.point(session.curve.start + session.curve.duration * shares[1:][np.diff(flying * 1) > 0])
    clip = embedded("backflip")
    laps = np.arange(round(maps.lap_seconds / clip.duration))
    own = (laps * clip.duration + flight.fit.time) / maps.lap_seconds * maps.curve.duration
    np.testing.assert_allclose(begins, maps.curve.point(maps.curve.start + own), atol=1.5e-3)
    plain = wire(run_config(clips=("backflip",), seconds=1.0), session.clips)
    assert session.servo.field.budget[0] > plain.servo.field.budget[0]
    rivers = run_config(clips=("cheer", "backflip"), mode="rivers", map="rivers", governor=True, figure="kinematic")
    gated = wire(rivers, load_clips(("cheer", "backflip"))[0])
    flies = [river.speeds[:, 0].max() > 0.0 for river in gated.field.bundle.rivers]
    assert flies == [False, True, False]


def test_animation_without_flights_needs_no_governor():
    config = run_config(clips=("cheer", "angry"))
    session = wire(config)
    clip = animation_along(session.parts.maps.haptic_map, session.curve)
    assert not clip_ballistics(clip).flights


def test_governor_in_stretch_mode_is_refused():
    with pytest.raises(ParameterError, match="--governor has no meaning with --mode stretch"):
        wire(run_config(mode="stretch", governor=True, clips=("cheer",)), load_clips(("cheer",))[0])
