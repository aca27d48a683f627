"""Distance of prepared clips from their captures, on motions whose distance is known."""

import numpy as np
import pytest

from models.humanoid.skeleton import JOINTS
from models.mocap.library import embedded
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.preparation.fidelity import Fidelity, fidelity
from models.mocap.preparation.looping import Looped, looped
from models.mocap.preparation.poses import resampled


@pytest.fixture(scope="module")
def walk():
    return resampled(embedded("walk"), 120.0)


def whole(clip: Clip) -> Looped:
    return Looped(clip, "cycle", 0.0, clip.duration, 0.0)


def test_a_clip_elsewhere_on_the_floor_is_as_captured(walk):
    moved = Clip(PlanarDisplacement(3.0, -2.0, 2.5).moved(walk.poses), walk.fps, "moved")
    found = fidelity(moved, walk, whole(walk), 1.0)
    assert found.root < 1e-9
    assert found.joints < 1e-7
    assert found.gait
    assert found.faults() == ()


def test_a_path_is_not_laid_upon_the_other_with_the_body_turned_away():
    """A body that sways forth and back by 10 cm is 14 cm RMS from one that sways the other way, not as captured."""
    rest = np.zeros((241, 75))
    rest[:, 3::4] = 1.0
    sway = 0.1 * np.sin(np.arange(241) * 2.0 * np.pi / 120.0)
    forth, back = rest.copy(), rest.copy()
    forth[:, 0], back[:, 0] = sway, -sway
    found = fidelity(Clip(forth, 120.0, "forth"), Clip(back, 120.0, "back"), whole(Clip(back, 120.0, "back")), 1.0)
    assert found.root == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-2)


def test_a_turned_joint_is_the_first_of_the_extremes(walk):
    poses, knee = walk.poses.copy(), JOINTS.index("left_knee")
    columns = slice(7 + 4 * knee, 11 + 4 * knee)
    turn = quaternions.about_axis(1, np.array(0.3))
    poses[30:50, columns] = quaternions.product(poses[30:50, columns], turn)
    poses[:, 2] += 0.06
    found = fidelity(Clip(poses, walk.fps, "bent"), walk, whole(walk), 1.0)
    assert found.extremes[0].joint == "left_knee"
    assert found.extremes[0].angle == pytest.approx(0.3, abs=1e-6)
    assert 30 / 120 <= found.extremes[0].when < 50 / 120
    assert found.joints == pytest.approx(0.3 * np.sqrt(20 / walk.n_frames / len(JOINTS)), rel=1e-6)
    assert found.root == pytest.approx(0.06, abs=1e-9)
    assert "the root is 6.0 cm" in found.faults()[0]


def test_the_way_to_rest_of_an_open_clip_is_not_compared(walk):
    part = Clip(walk.poses[: walk.n_frames // 6], 120.0, "part")
    made = looped(part, "open")
    assert made.start < -0.2
    found = fidelity(made.clip, part, made, 1.0)
    assert found.joints < 1e-7
    assert found.root < 1e-9
    assert not found.gait


def test_a_clip_at_another_pace_is_compared_moment_by_moment(walk):
    slow = resampled(Clip(walk.poses, 0.8 * walk.fps, "slow"), 120.0)
    found = fidelity(slow, walk, whole(slow), 0.8)
    assert found.joints < 1e-6


def test_a_lap_in_which_the_body_turns_over_is_no_gait(walk):
    poses, n = walk.poses.copy(), walk.n_frames
    wheel = 2.0 * np.pi * np.arange(n) / (n - 1)
    poses[:, 3:7] = quaternions.product(poses[:, 3:7], quaternions.about_axis(0, wheel))
    cartwheel = Clip(poses, walk.fps, "cartwheel")
    assert cartwheel.closes(1e-3)
    assert not fidelity(cartwheel, cartwheel, whole(cartwheel), 1.0).gait


def test_a_measure_just_beyond_its_bound_is_told_apart_from_it():
    found = Fidelity(np.deg2rad(3.0004), 0.0512, (), gait=True)
    assert found.faults() == (
        "joints are 3.0004° RMS from the capture; 3 at most",
        "the root is 5.1 cm RMS from the capture; 5 at most",
    )
