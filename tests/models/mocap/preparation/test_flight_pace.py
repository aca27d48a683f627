"""Flights tell the pace of a capture."""

import pytest

from models.gravity import GRAVITY
from models.humanoid.skeleton import CONTACT_RADIUS, HAND_CONTACTS
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.preparation.pace import falling, paced
from models.mocap.preparation.poses import contact_points


@pytest.mark.parametrize("name", ["jump", "backflip"])
def test_authored_flights_fall_with_gravity_and_keep_their_pace(name):
    clip = embedded(name)
    assert falling(clip) == pytest.approx(GRAVITY, abs=0.3)
    assert paced(clip).clip is clip


@pytest.mark.parametrize("rate", [1.3, 2.0])
def test_a_wrong_rate_is_found_and_undone(rate):
    clip = embedded("jump")
    found = paced(Clip(clip.poses, rate * clip.fps, "jump"))
    assert found.pace == pytest.approx(1.0 / rate, rel=0.02)
    assert found.clip.duration == pytest.approx(clip.duration, rel=0.02)


def test_what_falls_too_slowly_may_be_borne_and_keeps_its_pace():
    clip = embedded("jump")
    slow = Clip(clip.poses, 0.7 * clip.fps, "slow")
    assert paced(slow).clip is slow


def test_what_never_flies_keeps_its_pace():
    walk = embedded("walk")
    quick = Clip(walk.poses, 2.0 * walk.fps, "walk")
    assert paced(quick) == (quick, 1.0, None)


def test_somebody_on_the_hands_does_not_fly():
    clip = embedded("jump")
    poses = clip.poses.copy()
    # Upside down, hands on the floor.
    poses[:, 3:7] = (0.0, 1.0, 0.0, 0.0)
    poses[:, 2] -= contact_points(poses, HAND_CONTACTS)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    assert falling(Clip(poses, clip.fps, "handstand")) is None
