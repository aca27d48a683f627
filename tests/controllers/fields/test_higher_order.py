"""Fields of higher order: the selection of a river by the hand's velocity, at crossings of every kind."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.curves.branches import BRANCHES, branches
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.instructions import TRACE_DISTANCE, TRACE_PHASE, TRACE_RIVER
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from controllers.state import HandState
from experiments.setups.modes.rivers import ADMISSION, HYSTERESIS, SIGMA, river_bundle
from experiments.studies.field_figures import SPEED, crossing, figure_of_eight, straight_river
from tests.controllers.fields.field_probes import force_of, largest_jump, mass_in, run_over

SCALE = (ADMISSION * SPEED, SIGMA["discrete"] * SPEED, HYSTERESIS * SPEED)
R, S, H = SCALE
DRAG = 4.0


def _bundle(*rivers):
    return RiverBundle(rivers, tuple(f"river {i}" for i in range(len(rivers))))


def _pair(degrees):
    return _bundle(straight_river(0.0), straight_river(degrees))


def _run(program, hands):
    memory, wrenches = program.fresh_memory(), np.empty((len(hands), 6))
    run_over(*program.compiled(), memory, np.array([hand.vector() for hand in hands]), wrenches)
    return wrenches[:, :3], memory


def test_branches_are_the_local_minima_of_distance_within_the_ball():
    rng = np.random.default_rng(0)
    curve = figure_of_eight()
    blob, phases_distances, double_branches = curve.packed(), np.empty((BRANCHES, 2)), 0
    phases = np.linspace(0.0, 4.0, 8001)[:-1]
    for _ in range(400):
        p = curve.point(rng.uniform(0, 4)) * rng.choice([0.05, 1.0]) + rng.normal(size=3) * 0.005
        square = ((curve.point(phases) - p) ** 2).sum(1)
        is_minimum = (square <= np.roll(square, 1)) & (square < np.roll(square, -1)) & (square < 0.012**2)
        count = branches(blob, 0, *p, 0.012, phases_distances)
        assert count == is_minimum.sum()
        np.testing.assert_allclose(np.sort(phases_distances[:count, 0]) % 4.0, phases[is_minimum], atol=5.1e-4)
        if count:
            assert phases_distances[:count, 1].min() == pytest.approx(closest_phase(blob, 0, *p, np.nan)[1], abs=1e-11)
        double_branches += count == 2
    assert double_branches > 20


def test_one_branch_for_a_ball_over_the_whole_curve_or_across_the_seam():
    circle, found = Trajectory.circle(0.05, 4.0), np.empty((BRANCHES, 2))
    blob = circle.packed()
    for phase in (0.0, 1e-9, 4.0 - 1e-9, 0.01, 1.0):
        for radius in (0.01, np.inf):
            p = circle.point(phase) * 1.05
            assert branches(blob, 0, *p, radius, found) == 1
            np.testing.assert_allclose(circle.point(found[0, 0]), circle.point(phase), atol=1e-7)
    assert branches(blob, 0, np.nan, 0.0, 0.0, 0.01, found) == 0
    assert branches(blob, 0, 0.07, 0.0, 0.0, 0.01, found) == 0


def _reference(rivers, p, v, admission, sigma):
    """The smooth field by its formula in NumPy, with the nearest of densely sampled phases."""
    null, total, force = np.exp(-(admission**2) / (2 * sigma**2)), 0.0, np.zeros(3)
    for river in rivers:
        t = np.linspace(river.curve.start, river.curve.end, 200001)
        square = ((river.curve.point(t) - p) ** 2).sum(1)
        k = square.argmin()
        w = max(0.0, 1.0 - square[k] / river.epsilon**2) ** 3
        x = river.curve.velocity(t[k])
        e, y = v - x, (river.curve.point(t[k]) - p) / river.tau
        a = w * np.exp(-(e @ e - (e @ y) ** 2 / (y @ y + x @ x)) / (2 * sigma**2))
        total += a
        force += a * w * (river.drag / river.tau * (river.curve.point(t[k]) - p) + river.drag * (x - v))
    return force / (null + total)


@pytest.mark.slow
def test_smooth_field_matches_its_formula():
    rng = np.random.default_rng(1)
    rivers = (straight_river(0.0), straight_river(40.0), River(Trajectory.circle(0.05, 4.0), 0.03, 0.02, 3.0))
    field = HigherOrder(_bundle(*rivers), *SCALE)
    for _ in range(20):
        p, v = rng.uniform(-0.03, 0.03, 3) * [1, 1, 0.3], rng.normal(scale=0.06, size=3)
        expected = _reference(rivers, p, v, R, S)
        np.testing.assert_allclose(field.wrench(HandState.at(p, v)).force, expected, atol=2e-4)


def test_hand_on_one_river_at_a_crossing_feels_the_documented_share_of_the_other():
    for degrees in range(0, 181, 5):
        row = crossing(float(degrees))
        gap = 2.0 * SPEED * np.sin(np.radians(degrees) / 2.0)
        sigma = SIGMA["smooth"] * SPEED
        a, null = np.exp(-(gap**2) / (2 * sigma**2)), np.exp(-(R**2) / (2 * sigma**2))
        assert row.both == pytest.approx(DRAG * gap, abs=1e-9)
        assert row.smooth == pytest.approx(DRAG * gap * a / (1.0 + a + null), rel=1e-6, abs=1e-12)
        assert row.discrete_passing < 1e-12
        assert row.alone == pytest.approx(DRAG * gap if gap < R else 0.0, abs=1e-9)
        if degrees >= 30:
            assert row.smooth_passing < 5e-3
        if degrees >= 90:
            assert row.smooth_passing < 1e-9
            assert row.both_passing > 0.5


def _mismatch(river, hand):
    """Mismatch [m/s] of a hand and a straight river through the origin."""
    x = river.curve.velocity(0.8)
    e, y = hand.v - x, (x * (x @ hand.p) / (x @ x) - hand.p) / river.tau
    return np.sqrt(e @ e - (e @ y) ** 2 / (y @ y + x @ x))


@pytest.mark.slow
def test_smooth_field_tends_to_the_discrete_one_as_sigma_vanishes():
    rng = np.random.default_rng(2)
    compared = 0
    for _ in range(200):
        bundle = _pair(rng.uniform(20.0, 160.0))
        hand = HandState.at(rng.uniform(-0.008, 0.008, 3), rng.normal(scale=0.07, size=3))
        discrete = HigherOrder(bundle, R, 1e-4, 0.0, "discrete").wrench(hand).force
        gaps = sorted([*(_mismatch(r, hand) for r in bundle.rivers), R])
        if gaps[1] - gaps[0] < 5e-3:
            continue
        compared += 1
        errors = [np.linalg.norm(HigherOrder(bundle, R, s).wrench(hand).force - discrete) for s in (3e-2, 1e-3)]
        assert errors[1] < 0.03 * max(errors[0], 1e-3)
    assert compared > 100


def test_direction_and_speed_decide_the_admission():
    bundle = _bundle(straight_river(0.0))
    field = HigherOrder(bundle, 0.3 * SPEED, 0.05 * SPEED, 0.0, "discrete")
    off = [0.0, 0.004, 0.0]
    assert np.linalg.norm(field.wrench(HandState.at(off, [SPEED, 0, 0])).force) > 0.1
    for v in ([0.6 * SPEED, 0, 0], [1.4 * SPEED, 0, 0], [-SPEED, 0, 0], [0, SPEED, 0], [0, 0, 0]):
        assert not field.wrench(HandState.at(off, v)).force.any()


@pytest.mark.parametrize("form", ["smooth", "discrete"])
def test_river_admits_the_speeds_of_its_interval_at_each_phase(form):
    line = straight_river(0.0)
    river = River(line.curve, drag=DRAG, speeds=[[0.02, 0.03], [0.10, 0.20]])
    field = HigherOrder(_bundle(river), 0.01, 0.001, 0.0, form)
    for share in (0.1, 0.5, 0.9):
        p = line.curve.point(1.6 * share) + np.array([0.0, 0.003, 0.0])
        least, greatest = 0.02 + 0.08 * share, 0.03 + 0.17 * share
        for speed, admitted in ((least - 0.015, 0), (least, 1), (greatest, 1), (greatest + 0.015, 0)):
            force = np.linalg.norm(field.wrench(HandState.at(p, [speed, 0, 0])).force)
            assert (force > 0.05) == admitted


def test_hysteresis_keeps_a_hand_between_admission_and_release():
    program = HigherOrder(_bundle(straight_river(0.0)), 0.02, 1e-4, 0.01, "discrete").program()
    speeds = SPEED + np.array([0.025, 0.015, 0.025, 0.035, 0.025, 0.015])
    forces, memory = _run(program, [HandState.at([0, 0.003, 0], [s, 0, 0]) for s in speeds])
    taken = np.linalg.norm(forces, axis=1) > 0.0
    assert taken.tolist() == [False, True, True, False, False, True]
    assert memory[TRACE_RIVER] == 0.0


def test_river_brings_a_hand_to_its_own_pace_within_the_ease_time():
    river = replace(straight_river(0.0), speeds=[[0.6 * SPEED, 2.0 * SPEED]] * 2)
    program = HigherOrder(_bundle(river), *SCALE, "discrete", ease=0.4).program()
    times = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    for pace, first in ((0.7, 0.7), (1.3, 1.3), (0.3, 0.6), (0.95, 1.0), (1.05, 1.0)):
        # A hand that keeps its pace feels the damper against the current's; it is on the curve, where w = 1.
        hands = [HandState.at(river.curve.point(0.8 + pace * t), [pace * SPEED, 0, 0], t) for t in times]
        forces, _ = _run(program, hands)
        u = times.clip(0.0, 0.4) / 0.4
        current = first + (1.0 - first) * (10.0 * u**3 - 15.0 * u**4 + 6.0 * u**5)
        np.testing.assert_allclose(forces[:, 0], river.drag * (current - pace) * SPEED, atol=1e-9)


@pytest.mark.parametrize(("noise", "share"), [(0.014, 1.0), (-0.014, 1.0), (0.016, 1.0 + 0.016 / 0.06)])
def test_slow_river_takes_the_noise_of_encoders_for_no_pace(noise, share):
    river = straight_river(0.0)
    slow = Trajectory(np.asarray(river.curve.times) * SPEED / 0.06, river.curve.positions)
    river = replace(river, curve=slow, speeds=[[0.02, 0.2]] * 2)
    program = HigherOrder(_bundle(river), *SCALE, "discrete", ease=0.4).program()
    (force,), _ = _run(program, [HandState.at(slow.point(0.8), [0.06 + noise, 0.0, 0.0])])
    assert force[0] == pytest.approx(river.drag * (share * 0.06 - 0.06 - noise), abs=1e-9)


@pytest.mark.parametrize("inside", [-0.004, 0.004])
def test_hand_beside_a_bend_keeps_the_pace_of_its_phase_when_it_is_taken(inside):
    # Beside a circle a hand of the river's angular speed is slower or faster than the river, but its phase is not.
    angles = np.linspace(0.0, 2.0 * np.pi, 241)
    points = 0.05 * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    points[-1] = points[0]
    course = Trajectory(np.linspace(0.0, 4.0, 241), points, periodic=True)
    river = replace(straight_river(0.0), curve=course, speeds=[[0.02, 0.2]] * 2)
    program = HigherOrder(_bundle(river), *SCALE, "discrete", ease=0.4).program()
    rate, radius = 2.0 * np.pi / 4.0, 0.05 + inside
    for pace in (0.8, 1.0, 1.2):
        (force,), _ = _run(program, [HandState.at([radius, 0.0, 0.0], [0.0, pace * rate * radius, 0.0])])
        share = (1.0 - (inside / river.epsilon) ** 2) ** 3
        assert force[1] == pytest.approx(share * river.drag * rate * pace * (0.05 - radius), rel=1e-3)


def test_each_taking_of_a_hand_eases_it_anew():
    river = replace(straight_river(0.0), speeds=[[0.5 * SPEED, 2.0 * SPEED]] * 2)
    program = HigherOrder(_bundle(river), *SCALE, "discrete", ease=0.1).program()
    lost = HandState.at([0.0, 1.0, 0.0], [0.5 * SPEED, 0, 0], 0.3)
    slow = [HandState.at(river.curve.point(0.8), [0.5 * SPEED, 0, 0], t) for t in (0.0, 0.2)]
    forces, _ = _run(program, [*slow, lost, slow[0]._replace(t=0.4), slow[0]._replace(t=0.6)])
    along = forces[:, 0] / (river.drag * SPEED)
    np.testing.assert_allclose(along, [0.0, 0.5, 0.0, 0.0, 0.5], atol=1e-9)


def test_smooth_form_refuses_an_ease_time():
    with pytest.raises(ParameterError, match="leave out ease"):
        HigherOrder(_bundle(straight_river(0.0)), *SCALE, ease=1.0)


def test_discrete_river_keeps_the_hand_to_the_edge_of_its_tube_at_nearly_parallel_rivers():
    bundle = _pair(4.0)
    program = HigherOrder(bundle, *SCALE, "discrete").program()
    x, second = straight_river(0.0).curve.velocity(0.8), straight_river(4.0).curve
    # The hand follows river 2 from the crossing for 0.7 s, then moves to where only river 2 is.
    hands = [HandState.at(second.point(t), x) for t in np.linspace(0.8, 1.5, 50)]
    forces, memory = _run(program, hands)
    assert memory[TRACE_RIVER] == 0.0
    assert (np.linalg.norm(forces, axis=1) < 3.0).all()
    over = [HandState.at([0.05, y, 0.0], x) for y in np.linspace(0.0, 0.022, 30)]
    _, memory = _run(program, over)
    assert memory[TRACE_RIVER] == 1.0


def test_opposite_rivers_do_not_affect_each_other():
    row = crossing(180.0)
    assert row.discrete_passing < 1e-12
    assert row.smooth_passing < 1e-9
    program = HigherOrder(_pair(180.0), *SCALE, "discrete").program()
    _, memory = _run(program, [HandState.at([0, 0, 0], straight_river(180.0).curve.velocity(0.8))])
    assert memory[TRACE_RIVER] == 1.0


def test_coincident_rivers_act_as_one():
    river = straight_river(0.0)
    hand = HandState.at([0.01, 0.004, 0.0], [0.9 * SPEED, 0.0, 0.01])
    one, three = (HigherOrder(_bundle(*[river] * n), *SCALE) for n in (1, 3))
    single = one.wrench(hand).force
    # They differ only by the share of the null weight.
    np.testing.assert_allclose(three.wrench(hand).force, single, rtol=1e-3)
    discrete = HigherOrder(_bundle(river, river), *SCALE, "discrete")
    np.testing.assert_allclose(discrete.wrench(hand).force, river.wrench(hand).force, atol=1e-15)


@pytest.mark.parametrize("form", ["smooth", "discrete"])
def test_mass_passes_straight_through_the_crossing_of_a_figure_eight(form):
    curve = figure_of_eight()
    program = HigherOrder(_bundle(River(curve, 0.012, 0.013, DRAG)), *(2.0 * s for s in SCALE), form).program()
    path, memory = mass_in(program, curve.point(0.0), curve.velocity(0.0), np.zeros((8000, 3)))
    # After two laps it is where the river should have carried it.
    assert memory[TRACE_PHASE] == pytest.approx(0.0, abs=0.05) or memory[TRACE_PHASE] == pytest.approx(4.0, abs=0.05)
    second_half = path[2000:4000, 0]
    assert path[:2000, 0].min() > -0.004
    assert second_half.max() < 0.004
    assert memory[TRACE_DISTANCE] < 1e-3


def _carried_along_the_wave(form, lift):
    """Memory and position, after 1.5 s, of a mass that starts on the wave and is pushed up at its crest."""
    bundle = river_bundle(Trajectory.circle(0.0477, 4.0), 0.025, 4.0 / 300.0, 4.0, 0.012)
    wave, push = bundle["wave"].curve, np.zeros((1500, 3))
    # The wave touches the highest river at its crest, at 0.5 s, and is lowest at 1.5 s.
    push[450:700, 2] = lift
    path, memory = mass_in(
        HigherOrder(bundle, *SCALE, form).program(), wave.point(0.0), wave.velocity(0.0), push
    )  # fmt: skip
    return memory, path[-1]


def test_hand_changes_rivers_at_a_tangential_crossing_only_if_pushed():
    memory, end = _carried_along_the_wave("discrete", 0.0)
    assert memory[TRACE_RIVER] == 1.0
    assert end[2] == pytest.approx(-0.015, abs=3e-4)
    memory, end = _carried_along_the_wave("discrete", 0.5)
    assert memory[TRACE_RIVER] == 2.0
    assert end[2] == pytest.approx(0.015, abs=3e-4)


@pytest.mark.parametrize("lift", [0.0, 0.3, 0.6])
def test_smooth_field_blends_touching_rivers_without_losing_the_hand(lift):
    memory, _ = _carried_along_the_wave("smooth", lift)
    assert memory[TRACE_RIVER] >= 0.0
    assert memory[TRACE_DISTANCE] < 0.005


def _through_a_crossing(degrees, sigma):
    """Memory and last point of a free mass that passes a crossing 0.1 mm beside river 1."""
    program = HigherOrder(_pair(degrees), R, sigma).program()
    start, push = np.array([-0.045, 1e-4, 0.0]), np.zeros((1200, 3))
    path, memory = mass_in(program, start, np.array([SPEED, 0.0, 0.0]), push)
    return memory, path[-1]


def test_smooth_field_loses_no_hand_and_keeps_it_on_its_river_from_30_degrees():
    for degrees in (0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 45.0, 60.0, 90.0, 135.0, 180.0):
        memory, end = _through_a_crossing(degrees, SIGMA["smooth"] * SPEED)
        assert memory[TRACE_RIVER] >= 0.0
        # Up to 25° a mass without friction may change rivers or still be between them after 45 mm.
        if degrees >= 30.0:
            assert memory[TRACE_RIVER] == 0.0
            assert abs(end[1]) < 2e-3
    # A wider blend carries the hand between the rivers.
    memory, end = _through_a_crossing(30.0, 0.15 * SPEED)
    assert abs(end[1]) > 3e-3


@pytest.mark.parametrize("form", ["smooth", "discrete"])
def test_hand_returning_to_its_river_is_not_released_for_its_speed(form):
    circle = Trajectory.circle(0.05, 4.0)
    program = HigherOrder(_bundle(River(circle, 0.02, 4.0 / 300.0, DRAG)), *SCALE, form).program()
    away = circle.point(0.0) + np.array([0.006, 0.0, 0.004])
    path, memory = mass_in(program, away, circle.velocity(0.0), np.zeros((1000, 3)))
    # It returns at more than twice the speed of the current.
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() / 1e-3 > 2.0 * SPEED
    assert memory[TRACE_RIVER] == 0.0
    assert memory[TRACE_DISTANCE] < 2e-4


def test_smooth_field_is_continuous_in_space():
    rng = np.random.default_rng(5)
    bundles = [
        _bundle(straight_river(0.0), straight_river(70.0), straight_river(110.0)),
        _bundle(River(figure_of_eight(), 0.012, 0.02, 4.0), straight_river(20.0)),
    ]
    for bundle in bundles:
        program = HigherOrder(bundle, *SCALE).program()
        for _ in range(8):
            direction = rng.normal(size=3)
            direction *= 0.05 / np.linalg.norm(direction)
            centre = rng.uniform(-0.01, 0.01, 3)
            v = rng.normal(scale=SPEED, size=3)
            assert largest_jump(program, centre - direction, centre + direction, v) < 1e-9


def test_smooth_field_is_continuous_in_velocity():
    program = HigherOrder(_pair(60.0), *SCALE).program()
    rng = np.random.default_rng(6)
    for _ in range(20):
        v, u = rng.normal(scale=SPEED, size=(2, 3))
        u *= 1e-12 / np.linalg.norm(u)
        p = rng.uniform(-0.008, 0.008, 3)
        pair = [force_of(program, HandState.at(p, v + s * u)) for s in (0.0, 1.0)]
        assert np.linalg.norm(pair[1] - pair[0]) < 1e-9


RING = Trajectory.circle(0.05, 4.0)
_HALT = Trajectory([0.0, 1.0, 2.0, 3.0], [[0, 0, 0], [0.02, 0, 0], [0.02, 0, 0], [0.04, 0.01, 0]])
FIELDS = [
    HigherOrder(_bundle(River(RING), River(RING, np.inf), River(_HALT), River(figure_of_eight())), *SCALE, form)
    for form in ("smooth", "discrete")
]


@settings(max_examples=100)
@given(st.tuples(*[st.floats(-1e9, 1e9)] * 3), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_force_is_finite_everywhere(p, v):
    for field in FIELDS:
        assert np.isfinite(field.wrench(HandState.at(p, v)).force).all()


def test_force_is_finite_on_the_medial_axis_and_where_the_curve_halts():
    for field in FIELDS:
        for p in ([0, 0, 0], [0, 0, 0.01], [0.05, 0, 0], [0.02, 0, 0], [0.0201, 0, 0], [1e12, 0, 0]):
            for v in ([0, 0, 0], [SPEED, 0, 0], [1e9, 0, 0]):
                assert np.isfinite(field.wrench(HandState.at(p, v)).force).all()


def test_non_finite_hand_gives_nan():
    for field in FIELDS:
        assert np.isnan(field.wrench(HandState.at([np.nan, 0, 0])).force).all()
        assert np.isnan(field.wrench(HandState.at([0.05, 0, 0], [np.inf, 0, 0])).force).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [((0.0, 1.0), "admission"), ((1.0, 0.0), "sigma"), ((1.0, 1.0, -1.0), "hysteresis"), ((1, 1, 0, "odd"), "odd")],
)
def test_invalid_arguments_raise_parameter_error(options, message):
    with pytest.raises(ParameterError, match=message):
        HigherOrder(_pair(90.0), *options)
