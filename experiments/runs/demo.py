"""The demo: the four-clip cylinder of the paper's Fig. 3 (Donald & Henle 2000)."""

from experiments.config.run_config import RunConfig, User
from experiments.setups.parts.hands import lap_pushes
from experiments.setups.parts.lap import DEFAULT_LAP

_RELAXED_TIME = 2.2 * DEFAULT_LAP  # two laps: the device's friction makes them a little longer than the curve's own
_PUSH_FORCE = 4.0  # [N]; more than the motors can give continuously, but the pushes are short


def demo_config() -> RunConfig:
    """Two laps with a relaxed hand, then a lap in which the hand pushes outwards and then inwards."""
    pushes = lap_pushes(_RELAXED_TIME, DEFAULT_LAP, _PUSH_FORCE)
    return RunConfig(user=User(does="push", pushes=pushes), seconds=_RELAXED_TIME + 1.2 * DEFAULT_LAP)
