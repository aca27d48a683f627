"""Rivers of a lifted map: default gains, admissible speeds, and the push from one curve to the next."""

import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.fields.algebra.instructions import TRACE_RIVER
from controllers.haptic_map.lifted import Lifted
from controllers.state import HandState
from experiments.config.options import run_config
from experiments.setups.modes.lifted_runs import default_pushes, lifted_choice, lifted_river, pushed_over
from experiments.setups.modes.rivers import law_of
from experiments.setups.parts.defaults import resolved, river_gains
from geometry.quaternions import unit
from models.mocap.library import embedded
from tests.controllers.fields.field_probes import run_over

TURN = 2.0 * np.pi
MODE = resolved(run_config(map="map.npz", mode="rivers", user="push")).mode


def two_clips(transitions=((0.0, 1.0, 4.0, 0.1, 0.1),)):
    clips = [(clip.poses, clip.fps) for clip in (embedded("walk"), embedded("run"))]
    sites = np.tile(np.array([[0.045, 0.0], [0.051, 0.004]]), (64, 1, 1))
    angles = [
        TURN * np.linspace(0.0, 1.0, len(poses)) + start for (poses, _), start in zip(clips, (0.0, 1.0), strict=True)
    ]
    return Lifted(clips, [True, True], angles, sites, names=("first", "second"), transitions=np.array(transitions))


def test_default_gains_are_soft_for_lifted_rivers():
    assert river_gains(MODE) == (MODE.stiffness, MODE.damping) == (50.0, 20.0)
    for usual in (run_config(), run_config(map="map.npz")):
        mode = resolved(usual).mode
        assert (mode.stiffness, mode.damping) == (300.0, 8.0)
    around = resolved(run_config(mode="rivers")).mode
    assert river_gains(around) == (around.stiffness, around.damping) == (150.0, 16.0)
    explicit = resolved(run_config(map="map.npz", mode="rivers", stiffness=300.0, damping=8.0)).mode
    assert river_gains(explicit) == (300.0, 8.0)
    one = resolved(run_config(map="map.npz", mode="rivers", stiffness=40.0)).mode
    assert river_gains(one) == (40.0, 20.0)


def test_default_seek_gains_are_soft_for_lifted_maps():
    for mode in ("stretch", "stretch-then-follow"):
        soft, firm = (resolved(run_config(mode, map)).mode for map in ("map.npz", "cylindrical"))
        assert (soft.seek, soft.tube_damping) == (50.0, 20.0)
        assert (firm.seek, firm.tube_damping) == (150.0, 14.0)
        explicit = resolved(run_config(mode, "map.npz", seek=70.0)).mode
        assert (explicit.seek, explicit.tube_damping) == (70.0, 20.0)


def test_admissible_speeds_are_half_to_twice_the_river_speed():
    h_map = two_clips()
    for river in lifted_choice(h_map, MODE).bundle.rivers:
        speeds = np.asarray(river.speeds)
        own = np.linalg.norm(river.curve.velocity(np.linspace(river.curve.start, river.curve.end, len(speeds))), axis=1)
        np.testing.assert_allclose(speeds, np.outer(own, [0.5, 2.0]))
        assert river.tau == pytest.approx(0.4)
    assert lifted_river(h_map.curve(0), MODE).drag == 20.0


@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
def test_hand_that_crosses_over_fast_is_taken_by_the_other_river_before_it_has_passed_it(first, second):
    h_map = two_clips()
    program = law_of(MODE, lifted_choice(h_map, MODE)).program()
    memory, wrench = program.fresh_memory(), np.empty((1, 6))
    start, end = (h_map.curve_point(i, 4.0) for i in (first, second))
    along = np.array([-np.sin(4.0), np.cos(4.0), 0.0])
    # It goes with both rivers, and across at the speed of the faster one.
    for share in np.linspace(0.0, 1.0, 21):
        hand = HandState.at(start + share * (end - start), 0.1 * along + 0.13 * unit(end - start), 0.05 * share)
        run_over(*program.compiled(), memory, hand.vector()[None], wrench)
    assert memory[TRACE_RIVER] == second


@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
def test_push_begins_before_the_transition_towards_the_other_curve(first, second):
    h_map = two_clips()
    push = pushed_over(h_map, first, second, 4.0, 1.5, 20.0)
    place, direction = np.array(push.place), np.array(push.direction)
    r, z = h_map.site(first, np.array(np.arctan2(place[1], place[0])))
    np.testing.assert_allclose([np.hypot(place[0], place[1]), place[2]], [r, z], atol=1e-9)
    # A lap takes 2.2 s: the push begins 0.36 s before.
    assert (4.0 - np.arctan2(place[1], place[0])) % TURN == pytest.approx(0.36 / 2.2 * TURN, rel=1e-3)
    towards = np.array([0.006 * np.cos(4.0), 0.006 * np.sin(4.0), 0.004]) * (1.0 if second == 1 else -1.0)
    np.testing.assert_allclose(direction, towards, atol=1e-9)
    assert push.force == pytest.approx(3.6 * 20.0 * np.hypot(0.006, 0.004))


def test_default_pushes_go_over_at_the_best_transition_and_back():
    h_map = two_clips(((0.0, 1.0, 4.0, 0.1, 0.1), (0.0, 1.0, 1.0, 0.2, 0.2)))
    for curve in ("first", "second"):
        there, back = default_pushes(h_map, curve, MODE)
        assert np.array(there.direction) == pytest.approx(-np.array(back.direction))
        assert (there.at, back.at) == pytest.approx((2.2, 8.8))


def test_curve_without_transition_is_refused_with_the_existing_ones():
    with pytest.raises(ParameterError, match="'first' has no transition to push over at; there are: none"):
        default_pushes(two_clips(np.zeros((0, 5))), "", MODE)
