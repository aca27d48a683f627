"""Notions that models and controllers each define, since neither package knows the other, have one value."""

from controllers.certificates.flight.tolerance import JUDGING
from controllers.haptic_map.led import LARGEST_TURN as LED_TURN
from controllers.haptic_map.led import LEAST_TRAVEL as LED_TRAVEL
from models.floor import FRICTION
from models.mocap.preparation.laps import LARGEST_TURN, LEAST_TRAVEL


def test_a_lap_that_is_cut_is_one_that_can_be_led() -> None:
    assert (LEAST_TRAVEL, LARGEST_TURN) == (LED_TRAVEL, LED_TURN)


def test_certificates_judge_pushes_by_the_friction_of_the_floor() -> None:
    assert JUDGING.friction == FRICTION
