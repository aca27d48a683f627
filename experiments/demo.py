"""The demo: the four-clip cylinder of the paper's Fig. 3 (Donald & Henle 2000)."""

from experiments.wiring import RunConfig, lap_pushes

_LAP = 4.0


def demo_config() -> RunConfig:
    """Two laps of a relaxed hand, then one in which it pushes outwards and then inwards."""
    return RunConfig(user="push", seconds=3.0 * _LAP + 0.5, lap=_LAP, pushes=lap_pushes(2.0 * _LAP, _LAP))
