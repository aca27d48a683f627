"""Passes of an attempt at a feasible motion, and motions that need none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry.arrays import Array
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.preparation import attempt as passes
from models.mocap.preparation.attempt import Attempt, attempt, unchanged
from models.mocap.preparation.bounds import MAX_SKATE
from models.mocap.preparation.feasible import Feasible
from models.mocap.preparation.looping import LoopedClip
from models.mocap.preparation.poses import add_tangents
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed
from models.mocap.readers.own_bvh import write_bvh

CHEER = embedded("cheer")
CYCLE = LoopedClip(CHEER, "cycle", 0.0, CHEER.duration, 0.0)


def attempted(
    monkeypatch: pytest.MonkeyPatch, residuals: list[float], excesses: list[float], turn: float = 0.0
) -> tuple[Attempt, list[Clip]]:
    """An attempt whose optimiser turns every joint by an angle in each pass and leaves given residuals."""
    given: list[Clip] = []

    def optimised(clip: Clip, *_: Any, **options: Any) -> Feasible:
        given.append(clip)
        tangents = np.zeros((clip.n_frames, 57))
        tangents[:, 6::3] = turn
        turned = Clip(add_tangents(clip.poses, tangents), clip.fps, clip.name)
        return Feasible(turned, residuals[len(given) - 1], ())

    def contact_excess(_: Clip) -> Array:
        return np.full(3, excesses[len(given) - 1])

    monkeypatch.setattr(passes, "feasible", optimised)
    monkeypatch.setattr(passes, "_contact_excess", contact_excess)
    return attempt(CYCLE, CHEER, CHEER.fps), given


@pytest.mark.parametrize(("excesses", "count"), [([0.9], 1), ([2.0, 0.9], 2), ([6.0, 5.0, 4.0, 3.0, 2.0], 5)])
def test_passes_continue_until_contact_is_kept_five_at_most(
    excesses: list[float], count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, given = attempted(monkeypatch, [0.01] * 5, excesses, turn=0.02)
    assert len(given) == count
    assert made.near
    assert made.change.turned == pytest.approx(count * 0.02, rel=1e-2)  # from the capture, not from the last pass


def test_pass_without_a_feasible_motion_does_not_replace_one_that_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made, given = attempted(monkeypatch, [0.03, 0.2], [2.0, 1.5])
    assert len(given) == 2
    assert (made.near, made.residual) == (True, 0.03)


def test_pass_that_improves_no_measure_of_contact_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    made, given = attempted(monkeypatch, [0.01, 0.02], [2.0, 2.1])
    assert len(given) == 2
    assert made.residual == 0.01


def test_motion_that_is_not_feasible_is_not_pursued(monkeypatch: pytest.MonkeyPatch) -> None:
    made, given = attempted(monkeypatch, [0.2, 0.03], [2.0, 0.9])
    assert len(given) == 1
    assert (made.near, made.residual) == (False, 0.2)


def test_motion_unlike_the_capture_ends_the_attempt(monkeypatch: pytest.MonkeyPatch) -> None:
    made, given = attempted(monkeypatch, [0.01, 0.01], [2.0, 1.5], turn=0.6)
    assert len(given) == 1
    assert not made.near


@pytest.mark.parametrize("name", ["walk", "jump"])
def test_well_formed_clip_stays_as_it_is(name: str, tmp_path: Path) -> None:
    clip = embedded(name)
    write_bvh(clip, tmp_path / "mine.bvh")
    made = prepared(tmp_path / "mine.bvh")
    np.testing.assert_allclose(made.clip.poses, clip.poses, atol=1e-9)
    assert not any(made.attempt.change)
    assert made.near


def test_clip_with_a_sinking_sole_is_not_taken_as_it_is() -> None:
    poses = CHEER.poses.copy()
    poses[:, 2] -= 0.02
    assert unchanged(CHEER) is not None
    assert unchanged(Clip(poses, CHEER.fps, "sunk")) is None


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[WellFormed]:
    """Measures of the results of the passes."""
    found: list[WellFormed] = []

    def recorded(clip: Clip, flights: tuple[()]) -> WellFormed:
        found.append(well_formed(clip, flights))
        return found[-1]

    monkeypatch.setattr(passes, "well_formed", recorded)
    return found


@pytest.mark.slow
def test_jumps_whose_feet_slide_under_load_are_well_formed_after_a_second_pass(
    mocap: Path, measured: list[WellFormed]
) -> None:
    """After one pass a foot skates by 38 mm, and the physical figure has a residual of 9 % instead of 3."""
    made = prepared(mocap / "cmu_amc/16_09.amc")
    assert measured[0].skate > 0.03
    assert measured[-1].skate <= MAX_SKATE
    assert not well_formed(made.clip, ()).faults()


@pytest.mark.slow
def test_spin_whose_foot_slides_under_load_slides_less_with_every_pass(mocap: Path, measured: list[WellFormed]) -> None:
    """After one pass a foot skates by 127 mm under load, and the physical figure falls at 2.1 s."""
    prepared(mocap / "deepmimic/humanoid3d_spin.txt")
    first, *_, last = measured
    assert first.skate > 10.0 * last.skate
