"""``hvf clips``: list of the embedded clips."""

from dataclasses import dataclass

from experiments.console.output import Json, say


@dataclass(frozen=True)
class Command:
    """List the embedded clips."""

    json: Json = False

    def __call__(self) -> int:
        """Name them."""
        from models.mocap.library import embedded, embedded_names

        clips = [embedded(name) for name in embedded_names()]
        found = [{"name": c.name, "seconds": c.duration, "closed": c.closes(), "fps": c.fps} for c in clips]
        lines = [f"{c.name:14} {c.duration:5.2f} s  {'closed' if c.closes() else 'open'}" for c in clips]
        say(found, self.json, lines)
        return 0
