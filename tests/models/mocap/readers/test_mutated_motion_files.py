"""Motion files mutated at random: they load as clips of finite poses, or are refused in one line."""

import random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from models.errors import ModelError
from models.mocap.library import load
from models.mocap.readers.formats import READABLE_SUFFIXES, read_motion
from models.mocap.readers.motion_file import MotionFileError
from tests.models.mocap.readers.motion_files import AMC, ASF, BVH, CHARACTER, DEEPMIMIC

TOKENS = (
    "0", "-1", "1e9", "nan", "1_0", "9" * 30, "{", "}", "[", "]", ",", '"', ":", "\n", "\r", " ", "#", "End Site",
    "JOINT", "CHANNELS", "OFFSET", "MOTION", "Frames:", "root", "begin", "end", ":units", "null", "true", "\0", "٣",
)  # fmt: skip


@st.composite
def mutations(draw, text):
    """The text with a few pieces removed, duplicated or replaced by tokens or random text, and perhaps truncated."""
    content = text
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        length = draw(st.integers(0, 40))
        piece = draw(st.one_of(st.sampled_from(TOKENS), st.text(max_size=5), st.just(content[at : at + length] * 2)))
        content = content[:at] + piece + content[at + length :]
    return content[: draw(st.integers(0, len(content)))] if draw(st.booleans()) else content


FUZZ = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])


def assert_loads_or_is_refused(path):
    """A clip of finite poses, or the project's own error in one line; anything else fails the test."""
    message, poses = "", np.zeros(0)
    try:
        poses = load(path).clip.poses
    except ModelError as error:
        message = str(error)
    assert len(message.splitlines()) <= 1
    assert np.isfinite(poses).all()


@given(content=mutations(BVH))
@FUZZ
def test_mutated_bvh_files_load_or_are_refused(tmp_path, content):
    (tmp_path / "m.bvh").write_text(content, encoding="utf-8", errors="replace")
    assert_loads_or_is_refused(tmp_path / "m.bvh")


@given(skeleton=mutations(ASF), content=mutations(AMC), which=st.sampled_from(("skeleton", "motion")))
@FUZZ
@pytest.mark.slow
def test_mutated_amc_and_asf_files_load_or_are_refused(tmp_path, skeleton, content, which):
    (tmp_path / "m.asf").write_text(skeleton if which == "skeleton" else ASF, encoding="utf-8", errors="replace")
    (tmp_path / "m.amc").write_text(content if which == "motion" else AMC, encoding="utf-8", errors="replace")
    assert_loads_or_is_refused(tmp_path / "m.amc")


@given(content=mutations(DEEPMIMIC), character=st.none() | mutations(CHARACTER))
@FUZZ
def test_mutated_deepmimic_files_load_or_are_refused(tmp_path, content, character):
    character_file = tmp_path / "m_character.txt"
    character_file.unlink(missing_ok=True)
    if character is not None:
        character_file.write_text(character, encoding="utf-8", errors="replace")
    (tmp_path / "m_walk.txt").write_text(content, encoding="utf-8", errors="replace")
    assert_loads_or_is_refused(tmp_path / "m_walk.txt")


@given(content=st.binary(max_size=200), suffix=st.sampled_from((*READABLE_SUFFIXES, "")))
@FUZZ
def test_random_bytes_are_refused(tmp_path, content, suffix):
    (tmp_path / "m.asf").write_text(ASF)
    (tmp_path / f"m{suffix}").write_bytes(content)
    with pytest.raises(MotionFileError):
        read_motion(tmp_path / f"m{suffix}")


def test_truncated_captures_load_or_are_refused(mocap, tmp_path):
    """A cut in the last number of a frame is still a number; everywhere else it is an error."""
    rng = random.Random(7)
    for name in ("snu/run.bvh", "xia/xia_rest_1frame.bvh", "deepmimic/humanoid3d_run.txt"):
        content = (mocap / name).read_bytes()
        path = tmp_path / name.rsplit("/", 1)[1].replace("humanoid3d_", "")
        for _ in range(12):
            path.write_bytes(content[: rng.randrange(len(content))])
            assert_loads_or_is_refused(path)
