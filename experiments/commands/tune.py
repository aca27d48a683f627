"""``hvf tune``: a tuning, from its file to a certified configuration."""

from pathlib import Path
from typing import Annotated

import tyro

from experiments.config.part import part, whole_number
from experiments.console.output import Json
from experiments.trials.design.study_config import Where


@part
class Command(Where):
    """Tune parameters of a run on simulated people, among certified ones, or resume a tuning that was stopped."""

    tuning: Annotated[Path, tyro.conf.Positional]
    """TOML file of the tuning; see docs/how-to/tuning.md."""
    out: Path = Path("runs/tune")
    """Folder of journal, database, report and the chosen configuration; one that holds this tuning is continued."""
    candidates: Annotated[int | None, whole_number(1)] = None
    """Number of candidates, instead of the tuning's."""
    json: Json = False

    def __call__(self) -> int:
        """Tune, and report the chosen values."""
        from dataclasses import replace

        from experiments.trials.design.study_config import StudyError
        from experiments.tuning.tune_config import read_tuning

        config = read_tuning(self.tuning)
        if self.candidates is not None:
            config = replace(config, candidates=self.candidates)
        try:
            from experiments.tuning.tuning import CHOSEN, REPORT, run_tuning
        except ImportError as error:
            missing = f"tuning needs {error.name}; expected pip install 'haptic-vector-fields[study]'"
            raise StudyError(missing) from None
        text = self.tuning.read_text(encoding="utf-8-sig")
        found = run_tuning(config, self.out, text, self)
        written = f"Written to {self.out}: {REPORT} (open it in a browser), {CHOSEN} (for hvf run --config)."
        print(found.to_json() if self.json else f"{found}\n{written}")
        return 0
