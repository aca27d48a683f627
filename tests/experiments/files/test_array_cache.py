"""Cached arrays: reused exactly, recomputed if the file is corrupt, and stored separately for different inputs."""

import os

import numpy as np
import pytest

from experiments.files import array_cache
from experiments.files.array_cache import cached_array

SHAPE = (4, 3, 2)
VALUES = np.random.default_rng(0).normal(size=SHAPE)
INPUTS = (np.arange(5.0), np.array([2], dtype=np.uint8))


@pytest.fixture
def cached(tmp_path, monkeypatch):
    """Calls `cached_array` and counts how often the array was computed."""
    monkeypatch.setattr(array_cache, "results_folder", lambda module: tmp_path / module)

    class Keeper:
        folder, found = tmp_path / "cache", 0

        def __call__(self, made_of=INPUTS, values=VALUES):
            def find():
                self.found += 1
                return values

            return cached_array("cache", "sway", made_of, SHAPE, find)

        @property
        def files(self):
            return sorted(self.folder.iterdir())

    return Keeper()


def test_cached_array_is_exact_and_writable(cached):
    first, second = cached(), cached()
    assert cached.found == 1
    np.testing.assert_array_equal(second, VALUES)
    np.testing.assert_array_equal(first, second)
    second[0] = 1.0
    np.testing.assert_array_equal(cached(), VALUES)
    assert len(cached.files) == 1


def test_corrupted_cache_file_is_recomputed(cached):
    cached()
    (path,) = cached.files
    good = path.read_bytes()
    bad = [b"", good[:-1], good[:40], good + b"\0", bytes(len(good)), os.urandom(len(good)), b"\x93NUMPY" + good[6:]]
    bad += [good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :] for at in range(0, len(good), 17)]
    for times, content in enumerate(bad, start=2):
        path.write_bytes(content)
        np.testing.assert_array_equal(cached(), VALUES)
        assert cached.found == times
        assert path.read_bytes() == good


def test_unspecified_row_count_accepts_only_whole_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(array_cache, "results_folder", lambda module: tmp_path / module)

    def cached(values, shape):
        return cached_array("cache", "table", INPUTS, shape, lambda: values)

    np.testing.assert_array_equal(cached(VALUES, (-1, *SHAPE[1:])), VALUES)
    np.testing.assert_array_equal(cached(2.0 * VALUES, (-1, *SHAPE[1:])), VALUES)
    np.testing.assert_array_equal(cached(2.0 * VALUES[:2], (2, *SHAPE[1:])), 2.0 * VALUES[:2])
    np.testing.assert_array_equal(cached(np.ones((3, 5)), (-1, 5)), np.ones((3, 5)))


@pytest.mark.parametrize(
    "other",
    [
        (np.arange(6.0), INPUTS[1]),
        (INPUTS[0], np.array([3], dtype=np.uint8)),
        (INPUTS[0], np.array([2], dtype=np.int16)),
        (INPUTS[0].reshape(5, 1), INPUTS[1]),
        INPUTS[::-1],
        INPUTS[:1],
        (np.nextafter(INPUTS[0], 9.0), INPUTS[1]),
    ],
)
def test_different_inputs_use_another_cache_file(cached, other):
    cached()
    np.testing.assert_array_equal(cached(other, 2.0 * VALUES), 2.0 * VALUES)
    assert len(cached.files) == 2
    np.testing.assert_array_equal(cached(), VALUES)
    assert cached.found == 2


def test_uncreatable_cache_folder_is_ignored(cached):
    cached.folder.write_text("a file in its place")
    np.testing.assert_array_equal(cached(), VALUES)
    np.testing.assert_array_equal(cached(), VALUES)
    assert cached.found == 2


def test_folder_in_place_of_cache_file_is_ignored(cached):
    cached()
    (path,) = cached.files
    path.unlink()
    path.mkdir()
    np.testing.assert_array_equal(cached(), VALUES)
    assert cached.files == [path]
