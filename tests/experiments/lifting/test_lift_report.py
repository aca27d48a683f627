"""The report of `hvf lift`."""

from controllers.haptic_map.lifting.room import Room
from experiments.lifting.lift import lift_clips
from experiments.lifting.lift_report import report_lift


def test_implausible_in_betweens_are_named_in_the_report() -> None:
    report = report_lift(lift_clips(["walk", "run"], Room()), 1)
    assert "No motion half way" not in str(report)
    # Two clips differ in one direction, so h_* has rank 2.
    assert "Condition number of h_* along the curves: singular; half way between: singular." in report.lines()
    (pair,) = report.quality.between
    for fault in ({"slide": 0.03}, {"limits": 0.1}, {"penetration": 0.02}):
        bad = {pair: report.quality.between[pair]._replace(**fault)}
        last = report._replace(quality=report.quality._replace(between=bad)).lines()[-1]
        assert last.startswith(f"No motion half way: {pair} (feet slide by more than 2 cm")
        assert "tries the map first" in last
