"""Transitions: found where two motions agree in pose, velocity and support, and curves meet there."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.haptic_map.lifting.common_lap import N_SAMPLES, common_lap
from controllers.haptic_map.lifting.motion_features import Features, features
from controllers.haptic_map.lifting.transitions import compare, find_transitions
from tests.controllers.clips_for_maps import swinging, wxyz
from tests.controllers.haptic_map.lifting.swinging_motions import ROOM, WEIGHTS, lifted_at, motion


def clips_that_meet_once():
    """Two motions that differ except at one moment, at which pose and velocity are the same."""
    s = np.linspace(0.0, 1.0, 121)
    base = swinging(7, amplitude=0.2)
    other = base.copy()
    bump = np.sin(np.pi * (s - 0.4)) ** 4
    turn = Rotation.from_rotvec(np.outer(bump, [0.0, 1.2, 0.3]))
    other[:, 7:11] = wxyz(Rotation.from_quat(np.roll(base[:, 7:11], -1, axis=1)) * turn)
    return motion(base, "base"), motion(other, "other")


def test_transition_is_found_where_two_motions_agree_and_the_curves_meet_only_there():
    found = lifted_at(clips_that_meet_once())
    (transition,) = found.transitions
    base = common_lap([clips_that_meet_once()[0]], [features(clips_that_meet_once()[0], WEIGHTS, N_SAMPLES)])[0]
    assert base.start == 0.0
    assert np.hypot(transition.pose, transition.velocity) < 0.1
    assert transition.support == 0.0
    share = np.interp(transition.angle, found.angles[0], np.linspace(0.0, 1.0, 121))
    assert share == pytest.approx(0.4, abs=0.1)
    (meeting,) = found.after.meetings
    # Where they are wanted 2 mm apart; elsewhere they keep the separation. Level curves pass at 7.7 mm.
    assert meeting.distance < 0.8 * ROOM.separation
    assert np.degrees(meeting.slant) < 10.0
    assert found.after.separation >= ROOM.separation
    # Before the arrangement the curves were far apart there too.
    assert found.before.meetings[0].distance > 5.0 * meeting.distance


def features_of(rng, poses, stands):
    """Features of a motion at 200 steps of a lap, from its distance to another and the contacts of one foot."""
    own = rng.normal(size=(200, 6))
    own[:, 0] += poses
    return Features(own, np.tile([1.5, 0.0, 0.0, 0.5], (200, 1)), np.asarray(stands, float)[:, None])


def test_transition_needs_agreement_for_a_while_on_the_same_feet():
    steps, feet = np.arange(200), np.arange(200) % 100 < 50

    def transitions(distances, stands):
        rng = np.random.default_rng(3)
        one, other = features_of(rng, 0.0 * steps, feet), features_of(np.random.default_rng(3), distances, stands)
        return find_transitions(compare([one, other], np.ones((200, 2), bool), np.full(2, 2.0)), 0.5)

    # The same pose for a moment at step 40, nearly the same for 0.4 s about step 120.
    distances = np.full(200, 6.0)
    distances[40], distances[95:146] = 0.0, 0.5
    (transition,) = transitions(distances, feet)
    assert np.degrees(transition.angle) == pytest.approx(120 * 1.8, abs=10.0)
    assert transition.support == 0.0
    assert transition.speeds == pytest.approx((1.5, 1.5))
    # With another foot on the floor there is no transition.
    other = feet.copy()
    other[80:160] = ~feet[80:160]
    assert transitions(distances, other) == []


@pytest.mark.parametrize(
    ("strides", "speed", "found"), [((2, 2), 3.5, 1), ((2, 3), 3.5, 0), ((0, 0), 3.5, 0), ((2, 2), 4.5, 0)]
)
def test_gaits_in_step_have_a_transition_where_they_differ_least_if_their_speeds_are_near(strides, speed, found):
    steps, feet = np.arange(200), np.arange(200) % 100 < 50
    distances = 6.0 - np.cos(2.0 * np.pi * (steps - 70) / 200)
    walk, run = (features_of(np.random.default_rng(3), away, feet) for away in (0.0 * steps, distances))
    run.velocity[:, 0] = speed
    compared = compare([walk, run], np.ones((200, 2), bool), np.full(2, 2.0))
    transitions = find_transitions(compared, 0.3, strides)
    assert len(transitions) == found
    assert all(np.degrees(at.angle) == pytest.approx(70 * 1.8, abs=10.0) for at in transitions)


def test_curves_of_two_motions_that_differ_pass_in_reach_of_a_river_where_they_have_a_transition():
    walk, run = motion(swinging(7, amplitude=0.2), "walk"), motion(swinging(9, amplitude=0.9), "run")
    apart = lifted_at((walk, run))
    assert not apart.transitions
    assert apart.after.separation > 0.04
    in_step = lifted_at((replace(walk, strides=2), replace(run, strides=2)))
    (meeting,) = in_step.after.meetings
    assert meeting.distance < 0.012
    assert in_step.after.separation >= ROOM.separation


def test_motions_that_never_agree_have_no_transition():
    upright = motion(swinging(1), "low")
    bent = swinging(1)
    bent[:, 7:11] = wxyz(Rotation.from_quat(np.roll(bent[:, 7:11], -1, axis=1)) * Rotation.from_rotvec([0.0, 2.0, 0.0]))
    assert lifted_at([upright, motion(bent, "bent")]).transitions == ()
