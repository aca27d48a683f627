"""Replays of the median and the worst trial of a study, which are run again with a recording."""

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from experiments.results.folder import RECORDING, world_of
from experiments.trials.design.plan import Trial
from experiments.trials.trial.measures import MEASURES, TrialLog
from experiments.trials.trial.run_trial import MapCache, run_recorded
from sim.recording.recording import Recording
from sim.viewer.replay_html import replay_html


class Replay(NamedTuple):
    """Replay of a trial: which one it is and why it is shown, and the replay, a complete HTML document."""

    title: str
    page: str


def chosen_trials(frame: Any, measure: str) -> dict[str, int]:
    """Row numbers of the median and the worst trial by a measure; empty if no trial has the measure."""
    values = frame.loc[frame["state"].eq("done"), measure].dropna().sort_values(kind="stable")
    if not len(values):
        return {}
    worst = values.index[-1 if MEASURES[measure].better == "less" else 0]
    return {"median": int(values.index[len(values) // 2]), "worst": int(worst)}


def replays(trials: tuple[Trial, ...], frame: Any, measure: str) -> tuple[Replay, ...]:
    """Run the median and the worst trial again, recorded, and make their replays."""
    shown: list[Replay] = []
    for rank, row in chosen_trials(frame, measure).items():
        trial, value = trials[row], float(frame[measure].iloc[row])
        design = trial.design
        levels = ", ".join(f"{factor} {level}" for factor, level in design.condition.levels.items())
        title = (
            f"The {rank} trial by {MEASURES[measure].label}, {value:.3g}: user {design.user}, {levels}, repetition "
            f"{design.repetition + 1}"
        )
        shown.append(Replay(title, _replay_page(trial)))
    return tuple(shown)


def _replay_page(trial: Trial) -> str:
    session = MapCache().session(trial.config)
    with tempfile.TemporaryDirectory(prefix="hvf-") as folder:
        run_recorded(trial.config, session, TrialLog(session.servo, session.world), Path(folder))
        with Recording(Path(folder) / RECORDING) as recording:
            return replay_html(recording, world_of(recording))
