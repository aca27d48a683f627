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
def figure_file(tmp_path):
    poses = np.tile(rest_pose(), (5, 1))
    poses[:, 0] = np.linspace(0.0, 1.0, 5)
    write_bvh(Clip(poses, 25.0, "slide"), tmp_path / "slide.bvh")
    return tmp_path / "slide.bvh"


def test_embedded_clips_load_under_their_names():
    for name in embedded_names():
        clip = embedded(name)
        assert clip.name == name
        assert clip.n_frames > 1


def test_unknown_embedded_name_is_refused_with_the_known_names():
    with pytest.raises(ModelError, match="no embedded clip 'moonwalk'; there are "):
        embedded("moonwalk")


def test_converted_foreign_file_reloads_as_the_same_clip_without_retargeting(mocap, tmp_path):
    loaded = convert(mocap / "snu/run.bvh", tmp_path / "run.bvh")
    assert loaded.report is not None
    reloaded = load(tmp_path / "run.bvh")
    assert reloaded.report is None
    assert reloaded.clip.fps == loaded.clip.fps
    assert np.abs(pose_difference(reloaded.clip.poses, loaded.clip.poses)).max() < 1e-9


def test_convert_overwrites_an_existing_file_only_when_asked(figure_file, tmp_path):
    target = tmp_path / "out.bvh"
    target.write_text("precious")
    with pytest.raises(ModelError, match=r"out\.bvh exists and is left as it is; expected a new name, or --overwrite"):
        convert(figure_file, target)
    assert target.read_text() == "precious"
    convert(figure_file, target, overwrite=True)
    np.testing.assert_allclose(load_clip(target).poses, load_clip(figure_file).poses, atol=1e-9)


def test_convert_of_an_invalid_file_writes_nothing(tmp_path):
    (tmp_path / "bad.bvh").write_text("HIERARCHY")
    with pytest.raises(MotionFileError):
        convert(tmp_path / "bad.bvh", tmp_path / "out.bvh")
    assert not (tmp_path / "out.bvh").exists()


def test_convert_refuses_targets_that_cannot_be_written(figure_file, tmp_path):
    with pytest.raises(ModelError, match=r"only BVH can be written; expected a name that ends in \.bvh"):
        convert(figure_file, tmp_path / "out.fbx")
    with pytest.raises(ModelError, match="No such file or directory; expected a writable path"):
        convert(figure_file, tmp_path / "nowhere" / "out.bvh")


def test_convert_can_overwrite_its_source(figure_file):
    before = load_clip(figure_file)
    convert(figure_file, figure_file, overwrite=True)
    np.testing.assert_allclose(load_clip(figure_file).poses, before.poses, atol=1e-9)


@pytest.mark.parametrize(
    ("hints", "option"),
    [(Hints(up="+Y"), "--up"), (Hints(rest_frame=2), "--rest-frame"), (Hints(roles=Path("roles.toml")), "--roles")],
)
def test_convert_refuses_hints_that_a_file_of_the_figure_determines_itself(figure_file, tmp_path, hints, option):
    with pytest.raises(MotionFileError, match=rf"the figure's own skeleton.*expected no {option}"):
        convert(figure_file, tmp_path / "out.bvh", hints=hints)
    assert not (tmp_path / "out.bvh").exists()


def test_frame_rate_hint_applies_to_a_file_of_the_figure(figure_file):
    assert load(figure_file, Hints(frame_rate=50.0)).clip.fps == 50.0


def test_embedded_returns_an_independent_copy() -> None:
    original = embedded("walk").poses.copy()
    embedded("walk").poses[:] = 0.0
    np.testing.assert_array_equal(embedded("walk").poses, original)
