"""Paths that leap to another place while the limbs move on are carried on; see also the cut between two takes."""

import numpy as np

LEAPT = "the body leaps to another place in a frame at {}, though its limbs move on"


def test_path_that_leaps_while_the_limbs_move_on_is_carried_on(walk_rows):
    table, load_rows = walk_rows
    leaping = table.copy()
    leaping[20:, [0, 2]] += np.abs(table[:, 1]).max()
    clip, report, _ = load_rows(leaping)
    np.testing.assert_allclose(clip.poses, load_rows(table).clip.poses, atol=0.01)
    assert any(line.startswith(LEAPT.format("0.63 s")) for line in report.remarks)
    assert not any("jumps" in line for line in report.remarks)


def test_lap_repeated_from_its_start_walks_on(walk_rows):
    """Its last pose is its first: there the body does not move on either."""
    table, load_rows = walk_rows
    clip, report, _ = load_rows(np.vstack((table, table, table)))
    lap, n = load_rows(table).clip, len(table)
    places = [lap.poses[:, :2] + k * (lap.poses[-1, :2] - lap.poses[0, :2]) for k in range(3)]
    np.testing.assert_allclose(clip.poses[:, :2], np.vstack(places), atol=0.01)
    times = ", ".join(f"{(k * n - 1) / 30.0:.2f} s" for k in (1, 2))
    assert any(line.startswith(LEAPT.format(times)) for line in report.remarks)
