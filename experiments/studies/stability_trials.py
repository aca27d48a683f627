"""Experiment that could refute the stability certificates: predicted and observed onset of instability in MuJoCo.

Each trial draws a curve, a place on it, a damping, a clock and a hand. The critical stiffness is predicted from the
linear loop, and found independently in simulations: the onset is where the growth rate of the slowest mode, identified
from the motion across the curve, changes its sign. With Coulomb friction the onset depends on the amplitude; the
prediction then uses a describing function, and the onset is where an oscillation neither grows nor decays.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco
import numpy as np
import tyro
from matplotlib.figure import Figure

from controllers.certificates.loop.stability import slowest_mode
from experiments.certify.trial_simulation import Conditions, LoopTrial, draw_trial
from experiments.files.figure_files import save_figure
from experiments.studies.trial_onset import observed, observed_with_friction, predicted, with_friction
from geometry.whole_files import write_text

_WORLD_INTEGRATOR = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
FINE = Conditions()
FINER = Conditions(substeps=128)
INTEGRATOR_FINE, INTEGRATOR_COARSE = Conditions(64, _WORLD_INTEGRATOR), Conditions(8, _WORLD_INTEGRATOR)
ROUNDING = 1e-4  # [m] amplitude of a few encoder counts: a smaller oscillation is mostly quantisation
WITH_COULOMB_FRICTION, ROUNDED = Conditions(coulomb=True), Conditions(coulomb=True, rounded=True)


@dataclass(frozen=True)
class Row:
    """One trial: the random parameters, and critical k_r [N/m], predicted and observed; NaN if no onset was found.

    Attributes
    ----------
    period, delay, cutoff, b_d, mass, damping, stiffness : float
        T [s], delay [s], filter [Hz], b_d [N s/m], and the hand's mass [kg], damping [N s/m] and stiffness [N/m].
    predicted, observed : float
        Linear loop; simulation without Coulomb friction and rounding, by a Runge-Kutta method.
    own_fine, own_coarse : float
        Simulation with the world's own integrator at 64 and at 8 steps a period.
    amplitude, friction_predicted, friction_observed, rounded_observed : float
        Amplitude [m], and k_r with Coulomb friction at this amplitude; the last one also with quantised encoders.
    """

    period: float
    delay: float
    cutoff: float
    b_d: float
    mass: float
    damping: float
    stiffness: float
    predicted: float
    observed: float
    own_fine: float
    own_coarse: float
    amplitude: float
    friction_predicted: float
    friction_observed: float
    rounded_observed: float


def oscillation_amplitude(trial: LoopTrial, k_r: float) -> float:
    """Amplitude [m] at which the river commands 3 N, which the motors can give anywhere, but at most 1 mm."""
    loop = trial.loop()
    mode = slowest_mode(loop, k_r, trial.b_d, 0, swings=True)[1]
    return min(1e-3, 3.0 / float(np.linalg.norm(loop.force(k_r, trial.b_d)[0] @ mode)))


def run_trial(trial: LoopTrial) -> Row:
    """Predict and observe one trial under all conditions."""
    expected = predicted(trial)
    amplitude = oscillation_amplitude(trial, expected)
    onset = with_friction(trial, amplitude)
    return Row(
        period=trial.sampling.period, delay=trial.sampling.delay, cutoff=trial.sampling.cutoff, b_d=trial.b_d,
        mass=trial.hand.mass, damping=trial.hand.damping, stiffness=trial.hand.stiffness,
        predicted=expected, observed=observed(trial, expected, FINE),
        own_fine=observed(trial, expected, INTEGRATOR_FINE), own_coarse=observed(trial, expected, INTEGRATOR_COARSE),
        amplitude=amplitude, friction_predicted=onset.k_r,
        friction_observed=observed_with_friction(trial, onset, amplitude, WITH_COULOMB_FRICTION),
        rounded_observed=observed_with_friction(trial, onset, amplitude, ROUNDED) if amplitude > ROUNDING else np.nan,
    )  # fmt: skip


def stability_trials(out: Path = Path("runs/stability_trials"), count: int = 44, seed: int = 1) -> None:
    """Run random trials and write ``trials.json``, ``trials.md`` and ``trials.png``; repeat the worst with finer steps.

    Parameters
    ----------
    out : Path
        Folder.
    count : int
        Number of trials.
    seed : int
        Seed of all random draws.
    """
    rng = np.random.default_rng(seed)
    trials = [draw_trial(rng) for _ in range(count)]
    rows: list[Row] = []
    for number, trial in enumerate(trials):
        rows.append(run_trial(trial))
        row = rows[-1]
        print(
            f"{number + 1}/{count}: predicted {row.predicted:.1f} N/m, {_error(row.observed, row.predicted)}",
            flush=True,
        )
    errors = np.array([abs(row.observed / row.predicted - 1.0) for row in rows])
    worst = int(np.argmax(np.nan_to_num(errors, nan=np.inf)))
    again = observed(trials[worst], rows[worst].predicted, FINER)
    out.mkdir(parents=True, exist_ok=True)
    numbers = [{k: v if np.isfinite(v) else None for k, v in asdict(row).items()} for row in rows]
    write_text(out / "trials.json", json.dumps(numbers, indent=1) + "\n")
    report = table(rows) + (
        f"\nThe worst, trial {worst + 1}: {_error(rows[worst].observed, rows[worst].predicted)} at {FINE.substeps} "
        f"physics steps a period, {_error(again, rows[worst].predicted)} at {FINER.substeps}.\n"
    )
    write_text(out / "trials.md", report)
    save_figure(trials_figure(rows), out / "trials.png", dpi=150)
    print(report)


def table(rows: list[Row]) -> str:
    """Rows as Markdown, and the median and largest error of each column."""
    lines = [
        "| T [ms] | delay | hand m, b, k | b_d | predicted k_r | observed | 64 own steps | 8 own steps | A [mm] "
        "| friction, predicted | observed | with rounding |",
        "|" + "---|" * 12,
    ]
    for r in rows:
        lines.append(
            f"| {1e3 * r.period:.2f} | {round(r.delay / r.period)} T "
            f"| {r.mass:.2f}, {r.damping:.1f}, {r.stiffness:.0f} "
            f"| {r.b_d:.2f} | {r.predicted:.0f} | {_error(r.observed, r.predicted)} "
            f"| {_error(r.own_fine, r.predicted)} | {_error(r.own_coarse, r.predicted)} | {1e3 * r.amplitude:.2f} "
            f"| {_error(r.friction_predicted, r.predicted)} | {_error(r.friction_observed, r.friction_predicted)} "
            f"| {_error(r.rounded_observed, r.friction_predicted)} |"
        )
    lines.append("")
    for name, found, expected in (
        ("observed", "observed", "predicted"), ("64 own steps", "own_fine", "predicted"),
        ("8 own steps", "own_coarse", "predicted"), ("Coulomb friction", "friction_observed", "friction_predicted"),
        ("Coulomb friction and rounding", "rounded_observed", "friction_predicted"),
    ):  # fmt: skip
        errors = np.array([abs(getattr(r, found) / getattr(r, expected) - 1.0) for r in rows])
        known = errors[np.isfinite(errors)]
        summary = f"- {name}: {len(known)} of {len(rows)} with an onset"
        if len(known):
            summary += f"; error: median {100 * np.median(known):.2f} %, largest {100 * np.max(known):.2f} %"
        lines.append(summary)
    return "\n".join(lines) + "\n"


def trials_figure(rows: list[Row]) -> Figure:
    """Observed against predicted critical stiffness, and the errors."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    series = (
        ("no Coulomb friction", "predicted", "observed", "#2f6db3", "o"),
        ("Coulomb friction", "friction_predicted", "friction_observed", "#c2473b", "s"),
        ("Coulomb friction, encoders", "friction_predicted", "rounded_observed", "#7a5195", "^"),
    )
    for label, expected, found, colour, marker in series:
        x, y = (np.array([getattr(row, name) for row in rows]) for name in (expected, found))
        left.plot(x, y, marker, color=colour, mfc="none", ms=5, label=label)
        right.plot(x, 100.0 * (y / x - 1.0), marker, color=colour, mfc="none", ms=5)
    low, high = left.get_xlim()
    ends = np.array([max(low, 10.0), high])
    left.plot(ends, ends, color="#9aa0aa", lw=0.8, zorder=0)
    left.set(xscale="log", yscale="log", xlabel="predicted k_r [N/m]", ylabel="observed k_r [N/m]")
    left.set_title("critical stiffness", loc="left")
    left.legend(frameon=False, fontsize=8)
    right.axhspan(-5.0, 5.0, color="#eef3f9", zorder=0)
    right.set(xscale="log", xlabel="predicted k_r [N/m]", ylabel="observed / predicted − 1 [%]")
    right.set_title("error; shaded: 5 %", loc="left")
    return figure


def _error(found: float, expected: float) -> str:
    return f"{100.0 * (found / expected - 1.0):+.2f} %" if np.isfinite(found) else "none"


if __name__ == "__main__":
    tyro.cli(stability_trials)
