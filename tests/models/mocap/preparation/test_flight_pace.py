"""The pace of a capture, from the acceleration of its flights."""

import numpy as np
import pytest

from geometry.physics import GRAVITY
from models.humanoid.skeleton import CONTACT_RADIUS, HAND_CONTACTS
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import contact_points
from models.mocap.preparation.pace import correct_pace, flight_fall


@pytest.mark.parametrize("name", ["jump", "backflip"])
def test_authored_flights_fall_with_gravity_and_keep_their_pace(name):
    clip = embedded(name)
    assert flight_fall(clip).acceleration == pytest.approx(GRAVITY, abs=0.3)
    assert correct_pace(clip).clip is clip


@pytest.mark.parametrize("rate", [1.3, 2.0])
def test_wrong_frame_rate_is_detected_and_corrected(rate):
    clip = embedded("jump")
    result = correct_pace(Clip(clip.poses, rate * clip.fps, "jump"))
    assert result.pace == pytest.approx(1.0 / rate, rel=0.02)
    assert result.clip.duration == pytest.approx(clip.duration, rel=0.02)


def test_slow_fall_may_be_supported_and_keeps_its_pace():
    clip = embedded("jump")
    slow = Clip(clip.poses, 0.7 * clip.fps, "slow")
    assert correct_pace(slow).clip is slow


def test_body_that_is_accelerated_upwards_on_hovering_feet_is_in_no_flight():
    clip = embedded("jump")
    hovering = np.repeat(clip.poses[-1:], 60, axis=0)
    hovering[:, 2] += 0.1 + 2.5 * np.linspace(-0.25, 0.25, 60) ** 2
    longer = Clip(np.vstack((clip.poses, hovering)), clip.fps, "jump")
    assert flight_fall(longer) == pytest.approx(flight_fall(clip))
    assert flight_fall(Clip(hovering, clip.fps, "hovering")) is None


@pytest.mark.parametrize("rate", [0.2, 1.0])
def test_flights_follow_parabolas_at_any_rate_and_a_body_on_a_box_does_not(rate):
    jump = embedded("jump")
    assert flight_fall(Clip(jump.poses, rate * jump.fps, "jump")).departure < 0.05
    walk = embedded("walk")
    raised = np.vstack((walk.poses[:1], walk.poses, walk.poses[-1:]))
    raised[1:-1, 2] += 0.1 + 0.3 * np.minimum(5.0 - 5.0 * np.abs(np.linspace(-1.0, 1.0, len(walk.poses))), 1.0)
    assert flight_fall(Clip(raised, rate * walk.fps, "on a box")).departure > 0.1


def test_clip_without_flight_keeps_its_pace():
    walk = embedded("walk")
    fast = Clip(walk.poses, 2.0 * walk.fps, "walk")
    assert correct_pace(fast)[:3] == (fast, 1.0, None)


def test_handstand_is_no_flight():
    clip = embedded("jump")
    poses = clip.poses.copy()
    # Upside down, hands on the floor.
    poses[:, 3:7] = (0.0, 1.0, 0.0, 0.0)
    poses[:, 2] -= contact_points(poses, HAND_CONTACTS)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    assert flight_fall(Clip(poses, clip.fps, "handstand")) is None
