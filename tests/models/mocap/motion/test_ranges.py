import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import JOINTS, joint_range
from models.mocap.library import embedded
from models.mocap.motion.ranges import beyond_ranges


@pytest.mark.parametrize("angle", [120.0, 165.0, 179.0, 183.0, 190.0])
def test_elbow_bent_beyond_its_range_exceeds_it_by_the_excess_angle(angle):
    """Its range ends at -155° about z; beyond 180° the shortest rotation vector is on the other side."""
    pose = embedded("walk").poses[:1].copy()
    joint = JOINTS.index("left_elbow")
    vector = np.deg2rad(angle) * np.array([0.0, 0.0, -1.0])
    pose[0, 7 + 4 * joint : 11 + 4 * joint] = Rotation.from_rotvec(vector).as_quat(scalar_first=True)
    assert np.rad2deg(joint_range()[joint, 2, 0]) == pytest.approx(-155.0)
    assert np.rad2deg(beyond_ranges(pose)[0, joint]) == pytest.approx(angle - 155.0, abs=1e-6)
