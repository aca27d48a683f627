from pathlib import Path

import numpy as np
import pytest

from models.errors import ModelError
from models.humanoid.skeleton import rest_pose
from models.mocap.library import convert, embedded, embedded_names, load, load_clip
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.own_bvh import write_bvh
from models.mocap.retargeting.hints import Hints


@pytest.fixture
def own_file(tmp_path):
    poses = np.tile(rest_pose(), (5, 1))
    poses[:, 0] = np.linspace(0.0, 1.0, 5)
    write_bvh(Clip(poses, 25.0, "slide"), tmp_path / "slide.bvh")
    return tmp_path / "slide.bvh"


def test_embedded_clips_are_the_figures_own():
    for name in embedded_names():
        clip = embedded(name)
        assert clip.name == name
        assert clip.n_frames > 1


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ModelError, match="no embedded clip 'moonwalk'; there are "):
        embedded("moonwalk")


def test_converting_a_foreign_file_gives_its_clip_on_the_57_channels(mocap, tmp_path):
    loaded = convert(mocap / "snu/run.bvh", tmp_path / "run.bvh")
    assert loaded.report is not None
    again = load(tmp_path / "run.bvh")
    assert again.report is None
    assert again.clip.fps == loaded.clip.fps
    assert np.abs(pose_difference(again.clip.poses, loaded.clip.poses)).max() < 1e-9


def test_converting_does_not_overwrite_unless_told(own_file, tmp_path):
    target = tmp_path / "out.bvh"
    target.write_text("precious")
    with pytest.raises(ModelError, match=r"out\.bvh exists and is left as it is; expected a new name, or --overwrite"):
        convert(own_file, target)
    assert target.read_text() == "precious"
    convert(own_file, target, overwrite=True)
    np.testing.assert_allclose(load_clip(target).poses, load_clip(own_file).poses, atol=1e-9)


def test_a_file_that_cannot_be_read_leaves_nothing_behind(tmp_path):
    (tmp_path / "bad.bvh").write_text("HIERARCHY")
    with pytest.raises(MotionFileError):
        convert(tmp_path / "bad.bvh", tmp_path / "out.bvh")
    assert not (tmp_path / "out.bvh").exists()


def test_targets_that_cannot_be_written_are_refused(own_file, tmp_path):
    with pytest.raises(ModelError, match=r"only BVH can be written; expected a name that ends in \.bvh"):
        convert(own_file, tmp_path / "out.fbx")
    with pytest.raises(ModelError, match="No such file or directory; expected a place that can be written"):
        convert(own_file, tmp_path / "nowhere" / "out.bvh")


def test_a_clip_can_be_converted_onto_itself(own_file):
    before = load_clip(own_file)
    convert(own_file, own_file, overwrite=True)
    np.testing.assert_allclose(load_clip(own_file).poses, before.poses, atol=1e-9)


@pytest.mark.parametrize(
    ("hints", "option"),
    [
        (Hints(up="+Y"), "--up"),
        (Hints(rest_frame=2), "--rest-frame"),
        (Hints(roles=Path("roles.toml")), "--roles"),
    ],
)
def test_what_an_own_file_leaves_nothing_to_state_of_is_refused(own_file, tmp_path, hints, option):
    with pytest.raises(MotionFileError, match=rf"the figure's own skeleton.*expected no {option}"):
        convert(own_file, tmp_path / "out.bvh", hints=hints)
    assert not (tmp_path / "out.bvh").exists()


def test_the_frame_rate_of_an_own_file_can_be_stated(own_file):
    assert load(own_file, Hints(frame_rate=50.0)).clip.fps == 50.0


def test_an_embedded_clip_is_ones_own() -> None:
    kept = embedded("walk").poses.copy()
    embedded("walk").poses[:] = 0.0
    np.testing.assert_array_equal(embedded("walk").poses, kept)
