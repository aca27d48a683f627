"""Runs of true in masks, and removal of short gaps and short runs."""

import numpy as np
import pytest

from geometry.spans import cleaned, cyclic_spans, spans


def mask(marks: str):
    return np.array([mark == "#" for mark in marks])


@pytest.mark.parametrize(
    ("marks", "expected"),
    [("", []), ("...", []), ("###", [(0, 3)]), ("#..##.#", [(0, 1), (3, 5), (6, 7)]), (".##.", [(1, 3)])],
)
def test_spans_are_the_runs_of_true(marks, expected):
    assert spans(mask(marks)) == expected


@pytest.mark.parametrize(
    ("marks", "expected"),
    [
        ("####..####", "##########"), ("####...####", "####...####"), ("..####..", "..####.."),
        ("##.....####", ".......####"), ("##..##", "######"), ("##", "##"), ("..", ".."), ("#.", ".."),
    ],
)  # fmt: skip
def test_cleaned_fills_short_gaps_then_drops_short_runs_unless_all_is_true(marks, expected):
    given = mask(marks)
    np.testing.assert_array_equal(cleaned(given, 3, 4), mask(expected))
    np.testing.assert_array_equal(given, mask(marks))


@pytest.mark.parametrize(
    ("marks", "expected"),
    [
        ("##.....###", "##.....###"), ("##........", ".........."), (".#####..#.", "##########"), ("#", "#"),
        ("#####.#####", "###########"), (".####.....", ".####....."), ("....####..", "....####.."),
    ],
)  # fmt: skip
def test_cleaned_joins_runs_and_gaps_across_the_seam_of_a_closed_mask(marks, expected):
    given = mask(marks)
    np.testing.assert_array_equal(cleaned(given, 3, 4, closed=True), mask(expected))


def test_runs_of_a_cyclic_mask_wrap_round():
    assert cyclic_spans(np.array([1, 1, 0, 0, 1], dtype=bool)) == [(4, 7)]
    assert cyclic_spans(np.array([0, 1, 1, 0, 1, 0], dtype=bool)) == [(1, 3), (4, 5)]
    assert cyclic_spans(np.ones(4, dtype=bool)) == []
    assert cyclic_spans(np.zeros(4, dtype=bool)) == []
