"""The live scene of a run: the magnified workspace, and beside it the figure and its ghost.

As in the replay (`sim.viewer.replay_html`), Phantom, curves, tubes and forces are magnified and drawn beside the
figures, with axes parallel to the world's. A travelling figure is followed: the floor moves under it.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import viser

from geometry.arrays import Array
from models.world.scene import P_WH
from sim.viewer.actor import GHOST, Actor
from sim.viewer.drawn_curve import DrawnCurve
from sim.viewer.framing import MAX_TRAVEL
from sim.viewer.palette import FIELD, USER, rgb
from sim.viewer.shapes import body_prefix, body_shapes, drawn_radius, simplify_shapes
from sim.viewer.shown import Course, Moment

MAGNIFICATION = 8.0  # drawn over true lengths of the device
PHANTOM_AT = np.array([1.7, -0.6, 1.2])  # [m] where the hand frame's origin is drawn, out of the figure's reach
GHOST_AT = np.array([-0.75, 0.45, 0.0])  # [m] offset of the ghost from the figure
METRES_PER_NEWTON = 0.12  # drawn length of a force
LEAST_ARROW = 0.02  # [m] drawn length below which a force is hidden
LONGEST_SLICE = 0.11  # [m] drawn length of the largest force of a field slice
VIEW_TIME = 0.5  # [s] time constant with which the view follows a travelling figure
FIGURE_CELL, GHOST_CELL, PHANTOM_CELL = 0.006, 0.012, 0.0012  # [m] mesh resolution, coarse enough for a phone
RELOCATION_DISTANCE = 3.0  # [m] distance from the view's position beyond which a figure was relocated, not moved


def drawn_at(p_H: Array) -> Array:
    """Scene position of a point of the hand frame [m], shapes (..., 3)."""
    return PHANTOM_AT + MAGNIFICATION * p_H


def workspace_position(position: Array) -> Array:
    """Point of the hand frame that is drawn at a scene position [m], shapes (..., 3)."""
    return (position - PHANTOM_AT) / MAGNIFICATION


class LiveStage:
    """The live scene of a run.

    Parameters
    ----------
    scene : viser.SceneApi
        Scene of the page.
    model : mujoco.MjModel
        The world: bodies named ``phantom/…``, and ``figure/…`` or ``robot/…`` for the body that follows the hand.
    drawn : sequence of Course
        The curves.
    radius : float
        Radius of the tube around each curve [m], 0 for none.
    figure, ghost : str
        Labels of figure and ghost; empty if there is no ghost.
    """

    def __init__(
        self, scene: viser.SceneApi, model: mujoco.MjModel, drawn: Sequence[Course], radius: float,
        figure: str = "physical figure", ghost: str = "default animation",
    ):  # fmt: skip
        self._scene, self._model, self._data = scene, model, mujoco.MjData(model)
        shapes = body_shapes(model, body_prefix(model))
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "figure/root")
        self._root = int(model.jnt_qposadr[joint]) if joint >= 0 else -1
        self._phantom = Actor(
            scene, "phantom", simplify_shapes(body_shapes(model, "phantom/"), PHANTOM_CELL), MAGNIFICATION
        )
        self._figure = Actor(scene, "figure", simplify_shapes(shapes, FIGURE_CELL), 1.0)
        self._ghost = Actor(scene, "ghost", simplify_shapes(shapes, GHOST_CELL) if ghost else [], 1.0, GHOST)
        self._view_offset, self._start, self._t = np.zeros(2), np.full(2, np.nan), 0.0
        self._grid = scene.add_grid(
            "/floor", infinite_grid=True, cell_size=0.25, section_size=1.0, fade_distance=12.0, shadow_opacity=0.25
        )
        self._arrows = {name: self._arrow(name, color) for name, color in (("force", FIELD), ("user", USER))}
        self._slice = scene.add_arrows(
            "/slice", np.zeros((1, 2, 3)), (120, 135, 160), shaft_radius=0.004, head_radius=0.010, head_length=0.022
        )
        self._lag_line = scene.add_line_segments(
            "/lag", np.zeros((1, 2, 3)), rgb(USER), thickness=3.0, thickness_units="screen", visible=False
        )
        self._curves: list[DrawnCurve] = []
        for k, course in enumerate(drawn):
            tube = MAGNIFICATION * drawn_radius(course.points, radius)
            self._curves.append(DrawnCurve(scene, f"/curve/{k}", course, 0.006, tube))
            self.draw_course(k, course.points)
        self._label("phantom", f"Phantom, {MAGNIFICATION:g} times larger", PHANTOM_AT + np.array([-0.25, 0.0, 0.85]))
        if shapes:
            self._label("figure", figure, np.array([0.0, 0.0, 2.0]))
        self._ghost_label = self._label("ghost", ghost, GHOST_AT + np.array([0.0, 0.0, 2.0]))
        self._ghost_label.visible = self._has_ghost = self._root >= 0 and bool(ghost)

    @property
    def configuration_size(self) -> int:
        """Length of a configuration of the world (nq)."""
        return int(self._model.nq)

    def shows_ghost(self, shows: bool) -> None:
        """Show or hide the ghost, for example while takes are shown in its place."""
        if self._ghost.visible != shows:
            self._ghost.visible = shows
            self._ghost_label.visible = shows and self._has_ghost

    def draw_course(self, k: int, points: Array) -> None:
        """Draw curve k at its current points in the hand frame [m], shape (m, 3)."""
        self._curves[k].draw(drawn_at(points))

    def draw_slice(self, points: Array, forces: Array) -> None:
        """Draw the field's forces [N] at points of the hand frame [m], shapes (n, 3); with no points, hide them."""
        self._slice.visible = len(points) > 0
        if len(points) == 0:
            return
        scale = LONGEST_SLICE / max(float(np.linalg.norm(forces, axis=1).max()), 1e-9)
        at = drawn_at(points)
        self._slice.points = np.stack([at, at + scale * forces], axis=1).astype(np.float32)

    def show(self, shown: Moment) -> None:
        """Draw one moment."""
        data, shift = self._data, self._update_view_offset(shown.t, shown.qpos)
        data.qpos[:] = shown.qpos
        mujoco.mj_kinematics(self._model, data)
        self._phantom.pose(data, P_WH, MAGNIFICATION, PHANTOM_AT)
        self._figure.pose(data, shift, 1.0, np.zeros(3))
        if len(shown.ghost) and self._root >= 0:
            data.qpos[self._root : self._root + len(shown.ghost)] = shown.ghost
            mujoco.mj_kinematics(self._model, data)
            self._ghost.pose(data, shift, 1.0, GHOST_AT)
        self._grid.position = -shift % 1.0 * np.array([1.0, 1.0, 0.0])
        tip = drawn_at(shown.p)
        for name, force in (("force", shown.force), ("user", shown.user)):
            handle = self._arrows[name]
            handle.points = np.array([[tip, tip + METRES_PER_NEWTON * force]], dtype=np.float32)
            handle.visible = bool(np.linalg.norm(force) * METRES_PER_NEWTON > LEAST_ARROW)
        has_target = bool(np.isfinite(shown.target[0]))
        self._lag_line.visible = has_target
        if has_target:
            self._lag_line.points = np.array([[tip, drawn_at(shown.target)]], dtype=np.float32)

    def _update_view_offset(self, t: float, qpos: Array) -> Array:
        """Offset of the view (3,) [m]: the smoothed displacement of a travelling figure; else zero."""
        if self._root < 0:
            return np.zeros(3)
        position = qpos[self._root : self._root + 2]
        if np.isnan(self._start[0]):
            self._start = position.copy()
        displacement = position - self._start
        if np.linalg.norm(displacement - self._view_offset) > RELOCATION_DISTANCE:
            self._view_offset = displacement if np.linalg.norm(displacement) > MAX_TRAVEL else np.zeros(2)
        elif np.linalg.norm(displacement) > MAX_TRAVEL or np.any(self._view_offset != 0.0):
            share = 1.0 - np.exp(-max(t - self._t, 0.0) / VIEW_TIME)
            self._view_offset = self._view_offset + share * (displacement - self._view_offset)
        self._t = t
        return np.array([*self._view_offset, 0.0])

    def _arrow(self, name: str, color: str) -> viser.ArrowsHandle:
        return self._scene.add_arrows(
            f"/forces/{name}", np.zeros((1, 2, 3)), rgb(color), shaft_radius=0.014, head_radius=0.034,
            head_length=0.07, visible=False,
        )  # fmt: skip

    def _label(self, name: str, text: str, position: Array) -> viser.LabelHandle:
        return self._scene.add_label(
            f"/labels/{name}", text, position=position, anchor="bottom-center", font_screen_scale=1.1
        )


def light(scene: viser.SceneApi, shadows: bool = True) -> None:
    """Light a page: a soft sky, a light from the front, and viser's default lights, with or without shadows.

    viser's environment map, hardly visible on matt bodies, is switched off. Without it and without shadows, a page
    renders tens of times faster on a machine without a graphics card.
    """
    scene.configure_environment_map(None)
    scene.configure_default_lights(shadows, cast_shadow=shadows)
    sky, front = (1.6, 1.0) if shadows else (2.2, 2.6)
    scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255), ground_color=(190, 196, 210), intensity=sky)
    scene.add_light_directional("/lights/front", intensity=front, position=(1.0, -4.0, 4.0))
