"""``hvf trials``: a study, from its file to its report."""

from pathlib import Path
from typing import Annotated

import tyro

from experiments.config.part import part, whole_number
from experiments.console.output import Json
from experiments.trials.design.study_config import Where


@part
class Command(Where):
    """Run a study of simulated people from a TOML file, or resume one that was stopped, and report on it."""

    study: Annotated[Path, tyro.conf.Positional]
    """TOML file of the study; see docs/how-to/user-studies.md."""
    out: Path = Path("runs/study")
    """Folder of database, tables and report; one that holds this study is continued."""
    users: Annotated[int | None, whole_number(1)] = None
    """Number of users, instead of the study's."""
    seed: Annotated[int | None, whole_number(0)] = None
    """Seed of population and trials, instead of the study's."""
    json: Json = False

    def __call__(self) -> int:
        """Run the study, and report its results; exit code 1 if trials failed."""
        from experiments.trials.study import REPORT, Study

        study = Study.load(self.study).with_users(self.users, self.seed)
        result = study.run(self.out, self.threads, self.workers, self.cluster)
        print(result.to_json() if self.json else f"{result}\nWritten to {self.out}: {REPORT} (open it in a browser).")
        return 1 if result.failed else 0
