"""Pictures of the fields, and the table of crossings: ``python -m experiments.studies.field_figures docs/pictures``."""

import sys
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law
from controllers.fields.algebra.program import evaluate
from controllers.fields.bundle import RiverBundle
from controllers.fields.bunny import Bunny
from controllers.fields.edited import Edited, performance
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River, integrate
from controllers.state import HandState
from experiments.files.figure_files import save_figure
from experiments.results.pages.figures import PLAIN_STYLE
from experiments.setups.modes.rivers import ADMISSION, HYSTERESIS, SIGMA
from geometry.arrays import Array
from sim.viewer.palette import CURVE, FIELD, TUBE, USER

SPEED = 0.075  # of the rivers in the table and of the default curve [m/s]
DRAG = 4.0  # [N s/m]
ANGLE_STEP = 15  # between the angles of the table [degrees]


class Crossing(NamedTuple):
    """Force of river 2 on a hand that follows river 1, at their crossing and while it passes.

    Attributes
    ----------
    angle : float
        Angle between the rivers [degrees].
    both : float
        Force in the static sum [N].
    smooth, discrete : float
        Force in the fields of higher order; in the discrete one river 1 has the hand [N].
    alone : float
        Force in the discrete field without river 1: whether river 2 takes a hand that moves like this [N].
    both_passing, smooth_passing, discrete_passing : float
        Largest force from 30 mm before the crossing to 30 mm behind it [N].
    """

    angle: float
    both: float
    smooth: float
    discrete: float
    alone: float
    both_passing: float
    smooth_passing: float
    discrete_passing: float


def straight_river(degrees: float) -> River:
    """River through the origin of H at an angle to x, 0.12 m long, in the plane z = 0."""
    direction = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    times = np.linspace(0.0, 1.6, 17)
    return River(Trajectory(times, np.outer(SPEED * (times - 0.8), direction)), drag=DRAG)


def crossing(degrees: float) -> Crossing:
    """Forces at a crossing of two straight rivers, on a hand that follows the first."""
    pair = RiverBundle((straight_river(0.0), straight_river(degrees)), ("1", "2"))
    second = RiverBundle((straight_river(degrees),), ("2",))
    scale = (ADMISSION * SPEED, SIGMA["discrete"] * SPEED, HYSTERESIS * SPEED)
    smooth = HigherOrder(pair, ADMISSION * SPEED, SIGMA["smooth"] * SPEED)
    discrete = HigherOrder(pair, *scale, "discrete")
    # River 1 exerts no force on a hand that follows it at its own speed: all force comes from river 2.
    places = np.linspace(-0.03, 0.03, 121)
    alone = _felt_forces(HigherOrder(second, *scale, "discrete"), np.zeros(1))
    a, b, c = (_felt_forces(field, places) for field in (pair, smooth, discrete))
    at = len(places) // 2
    return Crossing(degrees, a[at], b[at], c[at], alone[0], a.max(), b.max(), c.max())


def _felt_forces(field: Law, places: Array) -> Array:
    """Force [N] on a hand that moves along x with the river's speed, at places x [m], one after the other."""
    program = field.program()
    memory, wrench = program.fresh_memory(), np.empty(6)
    forces: list[float] = []
    for x in places:
        hand = HandState.at([x, 0.0, 0.0], [SPEED, 0.0, 0.0])
        evaluate(*program.compiled(), memory, hand.vector(), wrench)
        forces.append(float(np.linalg.norm(wrench[:3])))
    return np.array(forces)


def crossing_table() -> str:
    """The table of crossings as Markdown."""
    lines = [
        "| angle | static sum | smooth | discrete | discrete, river 2 alone | sum, passing | smooth, passing "
        "| discrete, passing |",
        "|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for degrees in range(0, 181, ANGLE_STEP):
        row = crossing(float(degrees))
        cells = (_force_text(force) for force in row[1:])
        lines.append(f"| {degrees}° | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _force_text(force: float) -> str:
    # A force that is only rounding error is shown as zero.
    return f"{force:.4f}" if force >= 5e-5 else (f"{force:.0e}" if force > 1e-12 else "0")


def crossing_figure() -> Figure:
    """Force of river 2 on a hand on river 1 over the angle between them."""
    rows = [crossing(float(angle)) for angle in np.linspace(0.0, 180.0, 181)]
    angles = [row.angle for row in rows]
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    crossing_ax, passing_ax = figure.subplots(1, 2, sharey=True)
    crossing_ax.plot(angles, [row.alone for row in rows], color=USER, ls="--", label="discrete, river 2 alone")
    columns = (
        ("static sum", TUBE, [(row.both, row.both_passing) for row in rows]),
        ("smooth", FIELD, [(row.smooth, row.smooth_passing) for row in rows]),
        ("discrete", CURVE, [(row.discrete, row.discrete_passing) for row in rows]),
    )
    for name, colour, forces in columns:
        here, passing = zip(*forces, strict=True)
        crossing_ax.plot(angles, here, color=colour, label=name)
        passing_ax.plot(angles, passing, color=colour)
    for ax, title in ((crossing_ax, "at the crossing"), (passing_ax, "largest while passing")):
        ax.set(xlabel="angle between the rivers [°]", xticks=range(0, 181, 30), title=title)
    crossing_ax.set(ylabel="force of river 2 [N]")
    crossing_ax.legend()
    return figure


def _axes() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(4.6, 4.4), layout="constrained")
    return figure, figure.subplots()


def _draw_plane(ax: Axes, curves: list[Trajectory], epsilon: float) -> tuple[Array, Array]:
    """Curves with their tubes from above, in millimetres; returns the grid of a plot there."""
    for curve in curves:
        points = 1e3 * curve.point(np.linspace(curve.start, curve.end, 400))
        discs = [Circle((float(x), float(y)), 1e3 * epsilon) for x, y in points[:, :2]]
        ax.add_collection(PatchCollection(discs, facecolor="#dbe7f4", edgecolor="none", zorder=0))
        ax.plot(points[:, 0], points[:, 1], color=CURVE, lw=1.5)
    ax.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axis = np.linspace(-0.085, 0.085, 35)
    x, y = np.meshgrid(axis, axis)
    return x, y


def force_figure(field: Law, curves: list[Trajectory], epsilon: float, t: float) -> Figure:
    """Force of a field on a hand at rest in the plane z = 0, at time t [s]."""
    figure, ax = _axes()
    x, y = _draw_plane(ax, curves, epsilon)
    forces = np.array([field.wrench(HandState.at([a, b, 0.0], t=t)).force for a, b in zip(x.flat, y.flat, strict=True)])
    size = np.linalg.norm(forces, axis=1)
    felt = size > 1e-3 * size.max()
    # Arrow lengths are square roots of the forces, so that weak ones can be seen.
    arrows = forces / np.sqrt(np.maximum(size, 1e-12))[:, None]
    ax.quiver(1e3 * x.ravel()[felt], 1e3 * y.ravel()[felt], arrows[felt, 0], arrows[felt, 1], color=FIELD, width=0.003)
    ax.set_title(f"force on a hand at rest, up to {size.max():.1f} N", loc="left", fontsize=9)
    return figure


def edited_figure() -> Figure:
    """A river, a performance that left it, and integral curves of V + U, of V + U/2 and of V."""
    river = River(Trajectory.circle(0.05, 4.0), epsilon=0.045)
    times = np.linspace(0.0, 4.0, 401)
    bump = 0.02 * np.sin(0.5 * np.pi * np.clip(times - 1.0, 0.0, 2.0)) ** 2
    performed = performance(times, river.curve.point(times) * (1.0 + bump / 0.05)[:, None])
    figure, ax = _axes()
    _draw_plane(ax, [river.curve], 0.0)
    for weight, colour in ((0.5, TUBE), (1.0, FIELD)):
        edited = Edited(river, (performed,), (weight,))
        course = 1e3 * integrate(edited.flow, performed.point(0.0), times)
        ax.plot(
            course[:, 0], course[:, 1], color=colour, lw=2.5, alpha=0.7, label=f"integral curve of V + {weight:g} U"
        )
    points = 1e3 * performed.point(times)
    ax.plot(points[:, 0], points[:, 1], color=USER, ls="--", label="performed")
    ax.legend(loc="center", fontsize=8)
    return figure


def figure_of_eight() -> Trajectory:
    """A river that crosses itself: a figure of eight, 0.12 m by 0.06 m."""
    angle = np.linspace(0.0, 2.0 * np.pi, 129)
    points = np.stack((0.06 * np.sin(angle), 0.03 * np.sin(2.0 * angle), np.zeros(129)), axis=1)
    points[-1] = points[0]
    return Trajectory(4.0 * angle / (2.0 * np.pi), points, periodic=True)


def main(folder: Path) -> None:
    """Draw all pictures into a folder and print the table."""
    circle, small = Trajectory.circle(0.05, 4.0), Trajectory.circle(0.05, 4.0, (0.0, 0.02, 0.0))
    bundle = RiverBundle((River(figure_of_eight()), River(small)), ("eight", "ring"))
    pictures = {
        "follow": lambda: force_figure(Follow(circle, 300.0, 4.0, 0.03), [circle], 0.03, 0.0),
        "bunny": lambda: force_figure(Bunny(circle, 300.0, 4.0, 0.02, "point", "clock"), [circle], 0.0, 0.5),
        "rivers": lambda: force_figure(bundle, [figure_of_eight(), small], 0.02, 0.0),
        "crossing": crossing_figure,
        "edited": edited_figure,
    }
    for name, draw in pictures.items():
        with mpl.rc_context(PLAIN_STYLE):
            save_figure(draw(), folder / f"field-{name}.png", dpi=130)
    print(crossing_table())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
