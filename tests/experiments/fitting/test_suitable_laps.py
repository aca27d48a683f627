"""Laps and rounds that suit clips, and remarks on clips that are off their pace, for every kind of map."""

from dataclasses import replace

import numpy as np
import pytest

from controllers.motion.loops import checked_clip, closed_loop
from controllers.motion.strides import fit_to_lap, natural_lap
from experiments.config.options import run_config
from experiments.fitting.suitable_laps import (
    best_lap,
    closed_loops,
    fit_round,
    lap_suits_blend,
    off_pace,
    pace_mismatch,
    timing_clip,
)
from experiments.setups.setups import map_parts
from experiments.setups.wiring import wire
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip


def lasting(name: str, seconds: float) -> Clip:
    """An embedded clip at another pace."""
    clip = embedded(name)
    return replace(clip, fps=clip.fps * clip.duration / seconds, name=f"{name} of {seconds} s")


def test_pace_tolerance_is_tighter_if_a_clip_flies() -> None:
    walk, angry, run = embedded("walk"), embedded("angry"), embedded("run")
    loops = [closed_loop(checked_clip(clip.poses, clip.fps, clip.name), clip.fps) for clip in (walk, angry, run)]
    slower = replace(loops[1], duration=0.8 * loops[0].duration)
    assert lap_suits_blend((walk, angry), (loops[0], slower), loops[0].duration)
    assert not lap_suits_blend((run, angry), (loops[2], slower), loops[2].duration)
    slowest = replace(loops[1], duration=0.7 * loops[0].duration)
    assert not lap_suits_blend((walk, angry), (loops[0], slowest), loops[0].duration)


def test_lap_is_timed_by_the_first_grounded_clip() -> None:
    run, walk, cheer = embedded("run"), embedded("walk"), embedded("cheer")
    assert [timing_clip(clips) for clips in ((walk, run), (run, walk, cheer), (run, run))] == [0, 1, 0]
    # At this lap the cheer is off its pace, so only arms are blended, and each clip keeps its own pace.
    parts = map_parts(run_config(clips=("run", "walk", "cheer"), lap=2.2, seconds=1.0), figure_model())
    assert parts.haptic_map.legs_of == 1
    assert not any("run at" in remark or "walk at" in remark for remark in parts.remarks)


@pytest.mark.parametrize(
    ("clips", "lap", "laps", "paces"),
    [
        (("walk", "jump", "walk"), 1.2, 2, (0.92, 1.0, 0.92)),
        (("squat_dance", "cheer", "angry"), 4.0, 1, (0.9, 0.75, 0.9)),
        (("squat_dance", "squat_dance", "squat_dance"), 0.9, 1, (4.0, 4.0, 4.0)),
        (("squat_dance", "cheer", "walk"), 1.3, 3, (0.92, 0.77, 0.85)),
    ],
)
def test_river_clips_use_the_fewest_laps_that_keep_pace(clips, lap, laps, paces) -> None:
    config = run_config(map="rivers", mode="rivers", clips=clips, lap=lap, seconds=1.0)
    parts = map_parts(config, figure_model())
    assert parts.haptic_map.laps == laps
    played = [loop.duration / (laps * lap) for loop in parts.haptic_map.loops]
    np.testing.assert_allclose(played, paces, atol=0.01)
    assert any("a round of the clips takes" in remark for remark in parts.remarks) == (laps > 1)


def test_rivers_without_a_matching_period_are_reported() -> None:
    config = run_config(map="rivers", mode="rivers", clips=("spin", "angry", "squat_dance"), lap=0.5, seconds=1.0)
    parts = map_parts(config, figure_model())
    assert parts.haptic_map.laps == 4
    assert any("4 laps of 0.5 s play spin at" in remark for remark in parts.remarks)


def test_current_lap_is_not_advised() -> None:
    clips = embedded("angry"), embedded("jump")
    loops = [closed_loop(checked_clip(clip.poses, clip.fps, clip.name), clip.fps) for clip in clips]
    lap = natural_lap(loops)
    assert off_pace(clips, fit_to_lap(loops, 1.1 * lap), 1.1 * lap, 1, 0)[0].endswith(
        f"; --lap {lap:.1f} suits them best"
    )
    assert off_pace(clips, fit_to_lap(loops, lap), lap, 1, 0)[0].endswith("; no lap suits them all better")


def test_run_gets_one_lap_advice() -> None:
    session = wire(run_config(map="composite", figure="none", clips=("walk", "cheer", "cheer"), lap=1.2, seconds=1.0))
    assert sum("--lap" in remark for remark in session.remarks) == 1


@pytest.mark.parametrize(("kind", "lap"), [("composite", 4.8), ("cylindrical", 4.0)])
def test_advised_lap_keeps_pace_of_the_leg_clip(kind: str, lap: float) -> None:
    """Two jumps of 2.4 s: a composite has the legs of its first clip, a cylinder those of one that does not fly."""
    config = run_config(map=kind, figure="none", clips=("jump", "ginga", "angry"), lap=1.4, seconds=1.0)
    assert any(f"--lap {lap:.1f} suits them best" in remark for remark in map_parts(config, figure_model()).remarks)


def test_clip_alone_may_be_slower_rather_than_faster_and_less_of_either_with_flights() -> None:
    walk, jump = embedded("walk"), embedded("jump")
    loops = closed_loops((walk, jump))

    def suits(i: int, pace: float) -> bool:
        return pace_mismatch((walk, jump)[i : i + 1], loops[i : i + 1], loops[i].duration / pace) == 0.0

    assert [suits(0, pace) for pace in (0.74, 0.76, 1.0, 1.04, 1.06)] == [False, True, True, True, False]
    assert [suits(1, pace) for pace in (0.96, 0.98, 1.0, 1.01, 1.03)] == [False, True, True, True, False]


def test_round_keeps_the_pace_of_a_long_clip_that_is_not_the_first() -> None:
    """At a whole number of the first clip's 10.1 s the second would be a tenth too fast, as a pirouette that fell."""
    angry, cheer = lasting("angry", 5.05), lasting("cheer", 11.15)
    lap = best_lap((angry, cheer, angry), None)
    seconds, _ = fit_round((angry, cheer, angry), lap * np.arange(1.0, 5.0))
    paces = [loop.duration / seconds for loop in fit_to_lap(closed_loops((angry, cheer)), seconds)]
    assert min(paces) >= 0.75
    assert max(paces) <= 1.05


@pytest.mark.parametrize(
    ("seconds", "rounds", "chosen"),
    [
        (4.0, (4.0, 8.0), 4.0),
        (6.0, (4.0, 8.0, 12.0), 8.0),  # at 0.75 of its pace
        (6.0, (4.0, 12.0), 12.0),
        (4.0, (1.0, 2.0), 2.0),
    ],
)
def test_round_is_the_shortest_that_suits_all_or_the_best(
    seconds: float, rounds: tuple[float, ...], chosen: float
) -> None:
    assert fit_round((lasting("angry", 4.0), lasting("cheer", seconds)), np.array(rounds)) == (chosen, False)


def test_round_keeps_the_pace_of_the_others_where_one_clip_has_none_that_suits_it() -> None:
    """A jump of 2.4 s is as much too slow in rounds of 5.4 and 10.8 s, in which a spin plays at 0.67 and 1.0."""
    assert fit_round((embedded("jump"), lasting("spin", 3.6)), np.array([5.4, 10.8]))[0] == 10.8


def test_round_of_a_clip_that_lasts_longer_than_its_laps_may_keeps_its_pace() -> None:
    clip = lasting("cheer", 30.0)
    assert best_lap((clip, clip, clip), None) == pytest.approx(30.0 / 4)
