"""Comparison of a lifted map with a hand-made one: ``python -m experiments.studies.lifting_figures docs/pictures``."""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.lifting.room import Room
from experiments.files.figure_files import save_figure
from experiments.fitting.figure_legs import figure_legs
from experiments.lifting.lift import LiftedClips, lift_clips
from experiments.lifting.map_quality import N_SAMPLES, Layout, MapQuality, MotionMeasure, measure_map
from models.humanoid.skeleton import figure_model
from sim.viewer.palette import CURVE, FIELD, TUBE, USER

CLIPS = ("walk", "run", "jump", "backflip")
_COLOURS = (CURVE, FIELD, USER, TUBE)


def cylinder(lifted: LiftedClips, room: Room) -> Layout:
    """Hand-made layout: the same four clips at the corners of the same rectangle, in the given order."""
    motions = [(clip.poses, clip.fps) for clip in lifted.clips]
    haptic_map = Cylindrical(motions, room.r_range, room.z_range, figure_legs(figure_model()))
    corners = np.array([(r, z) for z in room.z_range for r in room.r_range])
    share = np.arange(N_SAMPLES + 1)[:, None] / N_SAMPLES
    times = share * np.array([clip.duration for clip in lifted.clips])
    return Layout(haptic_map, lifted.names, np.tile(corners, (N_SAMPLES, 1, 1)), times)


def comparison_table(lifted: MapQuality, hand_made: MapQuality) -> str:
    """Table of the quality of both maps, as Markdown."""
    rows = [
        ("least distance of two curves [mm]", *(f"{1e3 * q.separation:.1f}" for q in (hand_made, lifted))),
        *_spread_row("condition number of h_* along the curves", hand_made.conditioning, lifted.conditioning, 1.0),
        *_spread_row("the same half way between", hand_made.conditioning_between, lifted.conditioning_between, 1.0),
        *_spread_row("change of h_* [% of itself per mm]", hand_made.roughness, lifted.roughness, 100.0),
    ]
    worst = [MotionMeasure.worst(list(q.between.values())) for q in (hand_made, lifted)]
    for name, field, unit in (
        ("in-betweens: joints beyond their limits [°]", "limits", 180.0 / np.pi),
        ("in-betweens: soles slide [cm]", "slide", 100.0),
        ("in-betweens: below the floor [cm]", "penetration", 100.0),
        ("in-betweens: flights from free fall [cm]", "ballistic", 100.0),
    ):
        rows.append((name, *(f"{unit * float(getattr(measure, field)):.1f}" for measure in worst)))
    lines = ["| | hand-made cylinder | lifted |", "|---|--:|--:|"]
    return "\n".join([*lines, *(f"| {name} | {a} | {b} |" for name, a, b in rows)])


def _spread_row(
    name: str, first: tuple[float, float], second: tuple[float, float], unit: float
) -> list[tuple[str, str, str]]:
    cells = [" / ".join("∞" if np.isinf(v) else f"{unit * v:.3g}" for v in pair) for pair in (first, second)]
    return [(f"{name}, median / 9 of 10 below", cells[0], cells[1])]


def curves_figure(lifted: LiftedClips, hand_made: Layout) -> Figure:
    """Sites of both maps in the half plane (r, z), and the distances of the lifted curves round the lap."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    plane, lap = figure.subplots(1, 2, width_ratios=(1.0, 1.6))
    layout = lifted.layout()
    for i, (name, colour) in enumerate(zip(layout.names, _COLOURS, strict=True)):
        closed = 1e3 * np.concatenate([layout.sites[:, i], layout.sites[:1, i]])
        plane.plot(closed[:, 0], closed[:, 1], color=colour, label=name)
        plane.plot(*(1e3 * hand_made.sites[0, i]), "s", color=colour, ms=5)
    plane.set(xlabel="r [mm]", ylabel="z [mm]", aspect="equal", title="lifted (lines), hand-made (squares)")
    plane.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    angle = 360.0 * np.arange(N_SAMPLES) / N_SAMPLES
    for meeting in lifted.lifting.after.meetings:
        i, j = meeting.transition.first, meeting.transition.second
        apart = 1e3 * np.linalg.norm(layout.sites[:, i] - layout.sites[:, j], axis=1)
        # For each pair of curves: a line in the colour of one, dashed with the colour of the other.
        lap.plot(angle, apart, color=_COLOURS[i], lw=2.2)
        lap.plot(angle, apart, color=_COLOURS[j], lw=2.2, ls=(0, (4, 4)))
        lap.plot(
            np.degrees(meeting.transition.angle), 1e3 * meeting.distance, "o", color=_COLOURS[i],
            markeredgecolor=_COLOURS[j], markeredgewidth=1.8, ms=8,
        )  # fmt: skip
        highest = int(np.argmax(apart))
        lap.annotate(
            f"{layout.names[i]} – {layout.names[j]}", (angle[highest], apart[highest]), (0, 5),
            textcoords="offset points", ha="center", fontsize=8,
        )  # fmt: skip
    lap.set(xlabel="θ [°]", ylabel="distance of the curves [mm]", title="transitions found (at the dots)")
    lap.set_ylim(0.0, 1.12 * lap.get_ylim()[1])
    return figure


def main(folder: Path) -> None:
    """Draw the picture into a folder and print the table."""
    room = Room()
    lifted = lift_clips(CLIPS, room)
    hand_made = cylinder(lifted, room)
    with mpl.rc_context({"font.size": 9.0, "axes.titlesize": 9.0, "legend.frameon": False}):
        save_figure(curves_figure(lifted, hand_made), folder / "lifting.png", dpi=130)
    qualities = [measure_map(layout, lifted.clips, np.random.default_rng(1)) for layout in (lifted.layout(), hand_made)]
    print(comparison_table(*qualities))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
