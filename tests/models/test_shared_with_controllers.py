"""Constants that models and controllers both define, since neither imports the other, have equal values."""

from controllers.certificates.flight.tolerance import JUDGING
from controllers.haptic_map.led import LARGEST_TURN as LED_TURN
from controllers.haptic_map.led import LEAST_TRAVEL as LED_TRAVEL
from models.floor import FRICTION
from models.mocap.preparation.laps import LARGEST_TURN, LEAST_TRAVEL


def test_laps_and_led_maps_use_the_same_limits_of_turn_and_travel() -> None:
    assert (LEAST_TRAVEL, LARGEST_TURN) == (LED_TRAVEL, LED_TURN)


def test_certificates_use_the_friction_of_the_floor() -> None:
    assert JUDGING.friction == FRICTION
