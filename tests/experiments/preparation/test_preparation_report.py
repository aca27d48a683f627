"""The report of `hvf prepare`: flights as certificates define them, and what was added to the file's motion."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.flights.ballistics import clip_ballistics, clip_flights
from experiments.preparation.command import foot_slide
from experiments.preparation.followed import Followed
from experiments.preparation.prepared_file import PreparedFile, changes, doubts, losses
from geometry.physics import GRAVITY
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.mocap.preparation.attempt import Attempt, RmsChange
from models.mocap.preparation.bounds import MAX_RESIDUAL, MAX_RESIDUAL_IN_FLIGHTS
from models.mocap.preparation.fidelity import fidelity
from models.mocap.preparation.looping import LoopedClip, LostTurn
from models.mocap.preparation.pace import Paced
from models.mocap.preparation.poses import resampled
from models.mocap.preparation.prepare import HandLoad, Prepared, prepared
from models.mocap.preparation.stances import stances
from models.mocap.preparation.well_formed import well_formed
from tests.models.mocap.retargeting.rigs import Rig, write_rig


@pytest.mark.parametrize("name", embedded_names())
def test_clip_flights_equal_those_of_its_certificate(name):
    clip = embedded(name)
    fits = [flight.fit for flight in clip_ballistics(clip).flights]
    expected = [(fit.time, fit.time + fit.duration) for fit in fits]
    np.testing.assert_allclose(np.reshape(clip_flights(clip), (-1, 2)), np.reshape(expected, (-1, 2)))
    assert well_formed(clip, clip_flights(clip)).flights == len(fits)


def test_flight_across_the_loop_seam_is_one_flight():
    jump = embedded("jump")
    cut = next(
        part for k in range(0, jump.n_frames, 4)
        if clip_flights(part := Clip(jump.with_next_lap().poses[k : k + jump.n_frames], jump.fps, "jump"))[-1][1]
        > part.duration + 0.1
    )  # fmt: skip
    flights = clip_flights(cut)
    assert [end - start for start, end in flights] == pytest.approx([end - start for start, end in clip_flights(jump)])
    assert well_formed(cut, flights).flight_error < 0.1
    quick = Clip(cut.poses, 2.0 * cut.fps, "quick")
    assert well_formed(quick, clip_flights(quick)).flight_error == pytest.approx(3.0 * GRAVITY, rel=0.05)


def test_flights_raise_the_residual_bound():
    run = embedded("run")
    measures = well_formed(run, clip_flights(run))
    assert measures.flights > 0
    assert MAX_RESIDUAL < MAX_RESIDUAL_IN_FLIGHTS
    lacking = type(measures)(**{**vars(measures), "residual": (MAX_RESIDUAL + MAX_RESIDUAL_IN_FLIGHTS) / 2.0})
    assert not any("contact leaves a residual of" in line for line in lacking.faults())
    assert any(
        "contact leaves a residual of" in line for line in type(measures)(**{**vars(lacking), "flights": 0}).faults()
    )


def test_hovering_clip_has_unknown_ballistics_in_the_report():
    jump = embedded("jump")
    hovering = Clip(jump.poses + np.eye(75)[2] * 0.03, jump.fps, "hovering")
    (line,) = doubts(clip_ballistics(hovering))
    assert line.startswith("whether it is ballistic is unknown: ")
    assert "falls at" not in line  # of flights that are certified
    assert doubts(clip_ballistics(jump)) == ()


def test_turns_beyond_friction_are_reported():
    ginga = embedded("ginga")
    (line,) = doubts(clip_ballistics(Clip(ginga.poses, 4.0 * ginga.fps, "quick")))
    assert line.startswith("turns are refuted: friction permits up to 0.")
    at_limit = clip_ballistics(Clip(ginga.poses, 1.85 * ginga.fps, "at the limit"))  # missed within 0.24 mm
    assert at_limit.certificate.verdicts["turns"].verdict == "refuted"
    assert doubts(at_limit) == ()


@pytest.mark.slow
def test_two_frame_file_is_reported_as_mostly_rest(tmp_path):
    walk = embedded("walk")
    write_rig(Rig(), Clip(walk.poses[:2], walk.fps, "walk"), tmp_path / "two.bvh")
    lines = changes(prepared(tmp_path / "two.bvh"))
    assert "the file's motion is 0.01 s; the rest is coming to rest at both ends, which is not in the file" in lines[1]


def _made(falls: float | None, near: bool, departure: float = 0.0) -> Prepared:
    """A walk as prepared from a capture that turns by 90° after 1.2 s, which its cycle does not."""
    clip = embedded("walk")
    looped = LoopedClip(clip, "cycle", 0.0, clip.duration, 0.0, LostTurn(np.pi / 2.0, 1.2))
    schedule = stances(clip, clip)
    tried = Attempt(looped, clip, schedule, clip, 0.0, RmsChange(0.0, 0.0, 0.0), near)
    return Prepared(
        clip, clip, None, Paced(clip, 1.0, falls, departure), 0.0, HandLoad(0.0, 0.0),
        tried, fidelity(clip, clip, looped, 1.0), 0.0,
    )  # fmt: skip


def _looped(made: Prepared, looped: LoopedClip) -> Prepared:
    return made._replace(attempt=made.attempt._replace(cycle=looped))


@pytest.mark.parametrize(
    ("falls", "departure", "named"), [(0.5, 0.0, True), (0.5, 0.3, False), (9.0, 0.0, False), (None, 0.0, False)]
)
def test_slow_flights_lost_turns_and_left_out_events_are_reported(falls, departure, named):
    result = _made(falls, near=False, departure=departure)
    looped = result.looped
    eventful = losses(_looped(result, looped._replace(left_out=(1.2, 4.5))))
    assert "1.2 s of the capture, the first at 4.50 s, are unlike the cycle: --loop open keeps them" in eventful
    lines = losses(result)
    assert any("fall at 0.5 m/s², and would fall freely at" in line for line in lines) == named
    assert "at 1.20 s the capture has turned 90° further than its cycle ever does: --loop open keeps its turns" in lines
    less = looped._replace(lost_turn=LostTurn(0.4, 1.2))
    assert not any("has turned" in line for line in losses(_looped(result, less)))


@pytest.mark.parametrize(
    ("degrees", "told"),
    [(40.0, ", turns left by 40° in each lap"), (-400.0, ", turns right by 400° in each lap"), (5.0, "")],
)
def test_turn_of_a_cycle_is_told_with_its_side(degrees, told):
    """Seen from above, left is the sense of rotation from x to y."""
    made = _made(None, near=True)
    angles = np.deg2rad(degrees) * np.linspace(0.0, 1.0, made.clip.n_frames)
    poses = [PlanarDisplacement(0.0, 0.0, a).moved(p) for a, p in zip(angles, made.clip.poses, strict=True)]
    turning = made._replace(clip=Clip(np.array(poses), made.clip.fps, "turning"))
    assert changes(turning)[0] == f"cycle 0.00 to 2.20 s, whose ends were 0.0° apart{told}: 2.20 s"
    assert ", turns" not in changes(_looped(turning, made.looped._replace(kind="open")))[0]


@pytest.mark.parametrize("near", [True, False])
def test_lines_are_in_the_order_of_importance(near):
    """First falls and the lack of a feasible motion, then what can be seen, limits and distance, and advice last."""
    result = _made(None, near)
    sound = well_formed(result.clip, ())
    bent = replace(sound, excess=0.1, bent="left_knee", strain=1.2)
    faulty = replace(bent, residual=0.2, skate=0.02, depth=0.03, highest=0.02)
    far = result.fidelity._replace(joints=0.2)
    falls = Followed(0.1, 2.5)
    outcome = PreparedFile(result._replace(fidelity=far), faulty, falls, 0.05, ("flight at 1 s",), ())
    first, *below = str(outcome).splitlines()
    assert first.startswith(f"{result.clip.name}: not well-formed; ")
    starts = [
        "the physical figure falls at 2.5 s", *(() if near else ("no feasible motion is near",)),
        "a foot slides by 50.0 mm along the floor; 30 at most",
        "contact leaves a residual of", "feet skate by", "a sole goes", "soles stand at",
        "left_knee is 5.7° beyond its range", "", "flight at 1 s", "joints are", "at 1.20 s the capture has",
        "try --loop START:END",
    ]  # fmt: skip
    assert len(below) == len(starts)
    assert all(line.startswith(f"  {start}") for line, start in zip(below, starts, strict=True))
    assert outcome.faults() == tuple(line.strip() for line in below[:-2])


def test_a_well_formed_clip_has_one_line_and_what_it_lacks():
    result = _made(None, near=True)
    outcome = PreparedFile(result, well_formed(result.clip, ()), Followed(0.01), 0.01, (), ())
    first, lost = str(outcome).splitlines()
    assert first.startswith(f"{result.clip.name}: well-formed; ")
    assert lost.endswith(": --loop open keeps its turns")
    assert not outcome.faults()


def test_feet_that_cross_the_floor_without_a_step_slide():
    poses = np.repeat(resampled(embedded("cheer"), 120.0).poses[:1], 60, axis=0)
    still = foot_slide(Clip(poses, 120.0, "still"))
    poses[:, 0] += 0.15 * np.clip((np.arange(60) - 30) / 6.0, 0.0, 1.0)
    assert still < 1e-9
    # The clip closes, since it moves by 0.15 m as a whole, and its next lap continues it.
    assert foot_slide(Clip(poses, 120.0, "jump")) == pytest.approx(0.3, abs=0.001)
