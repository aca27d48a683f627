"""``hvf track``: the physical figure on its own."""

from typing import Annotated

from tyro.conf import Positional

from experiments.config.part import above, at_least, part
from experiments.console.output import Json, say
from sim.body.figure_state import FigureGains

_GAINS = FigureGains()


@part
class Command:
    """Let the physical figure follow clips on its own, and report how well it does."""

    clips: Positional[tuple[str, ...]] = ()
    """Names of embedded clips, or files; all embedded clips by default."""
    seconds: Annotated[float, above(0.0, unit="s")] = 10.0
    """Simulated time for each [s]."""
    raw: bool = False
    """Take motion files as captured; by default they are prepared once, as by hvf prepare."""
    residual_force: Annotated[float, at_least(0.0)] = _GAINS.force_bound
    """Largest residual force at the root, as a fraction of body weight [1]."""
    residual_moment: Annotated[float, at_least(0.0)] = _GAINS.moment_bound
    """Largest residual moment, as a fraction of body weight × stature [1]."""
    json: Json = False

    def __call__(self) -> int:
        """Track."""
        from experiments.runs.track import track_clips

        reports = track_clips(self.clips, self.seconds, self.raw, (self.residual_force, self.residual_moment))
        say(reports, self.json, [f"{name}: {report}" for name, report in reports.items()])
        return 0
