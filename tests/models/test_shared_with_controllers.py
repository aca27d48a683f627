"""Constants that models and controllers both define, since neither imports the other, have equal values."""

from controllers.haptic_map.led import MAX_TURN as LED_TURN
from controllers.haptic_map.led import MIN_TRAVEL as LED_TRAVEL
from models.mocap.preparation.laps import MAX_LAP_TURN, MIN_LAP_TRAVEL


def test_laps_and_led_maps_use_the_same_limits_of_turn_and_travel() -> None:
    assert (MIN_LAP_TRAVEL, MAX_LAP_TURN) == (LED_TRAVEL, LED_TURN)
