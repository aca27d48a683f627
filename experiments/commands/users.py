"""``hvf users``: simulated people against published laws."""

from pathlib import Path
from typing import Annotated

from experiments.config.part import part, whole_number
from experiments.console.output import Json, say
from experiments.console.progress import working


@part
class Command:
    """Compare simulated people with published laws of human movement: a table, and a figure each."""

    out: Path = Path("runs/users")
    """Folder to write."""
    people: Annotated[int, whole_number(1)] = 6
    """Number of people of a population."""
    seed: Annotated[int, whole_number(0)] = 1
    """Seed of the population and of its noise."""
    laws: tuple[str, ...] = ()
    """fitts, scatter, steering, power-law, tremor, step-response, grip, practice, endurance; all by default."""
    overwrite: bool = False
    """Replace the table that the folder holds."""
    json: Json = False

    def __call__(self) -> int:
        """Exit code 0 if every law holds, 1 if one does not."""
        from experiments.studies.user_laws.report import laws_into, lines

        with working("measuring people", self.people):
            laws = laws_into(self.out, self.people, self.seed, self.laws, self.overwrite)
        say(laws, self.json, lines(laws))
        return 0 if all(law.holds for law in laws) else 1
