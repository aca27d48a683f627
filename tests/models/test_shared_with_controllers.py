"""Notions that models and controllers each define, since neither package knows the other, have one value."""

from controllers.certificates.flight.flight_fit import SHORTEST_FLIGHT as JUDGED
from controllers.certificates.flight.tolerance import JUDGING
from controllers.haptic_map.led import LARGEST_TURN as LED_TURN
from controllers.haptic_map.led import LEAST_TRAVEL as LED_TRAVEL
from models.floor import FRICTION
from models.mocap.preparation.bounds import SHORTEST_FLIGHT
from models.mocap.preparation.laps import LARGEST_TURN, LEAST_TRAVEL


def test_a_prepared_clip_and_a_certificate_call_the_same_gaps_of_support_flights() -> None:
    assert JUDGED == SHORTEST_FLIGHT


def test_a_lap_that_is_cut_is_one_that_can_be_led() -> None:
    assert (LEAST_TRAVEL, LARGEST_TURN) == (LED_TRAVEL, LED_TURN)


def test_certificates_judge_pushes_by_the_friction_of_the_floor() -> None:
    assert JUDGING.friction == FRICTION
