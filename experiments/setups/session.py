"""A wired run: its parts, the constant data that its recording keeps, and the animation of its unedited curve."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.fields.algebra.law import Law
from controllers.fields.higher_order import HigherOrder
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.haptic_map.base import HapticMap
from controllers.state import HandState, stylus_path
from controllers.walking.walker import walker_at
from experiments.fitting.figure_legs import packed_legs
from experiments.setups.parts.devices import recorded_as
from experiments.setups.parts.part_types import Parts, Settings
from geometry.arrays import Array
from models.humanoid.skeleton import standing_com
from models.mocap.motion.clip import Clip
from models.phantom.parameters import PREMIUM_1_5
from models.world.scene import P_WH
from sim.devices.simulated import SimulatedPhantom
from sim.loop.loop import BLOCK_SECONDS, Loop, Observer, ignore
from sim.loop.servo import Servo
from sim.reference.reference import make_reference, map_poses, reference_along
from sim.users.participant import Participant
from sim.viewer.shown import COURSE_POINTS
from sim.world.world import World


@dataclass(frozen=True)
class Session:
    """A wired run that has not begun: its parts, world, linked servo and remarks."""

    parts: Parts
    world: World
    servo: Servo
    remarks: tuple[str, ...]

    @property
    def config(self) -> Settings:
        """Figure, device and clock; for a configured run its `RunConfig`, with all defaults filled in."""
        return self.parts.config

    @property
    def clips(self) -> tuple[Clip, ...]:
        """Clips that the figure plays."""
        return self.parts.maps.clips

    @property
    def curve(self) -> Trajectory:
        """Curve along which the field leads."""
        return self.parts.course

    @property
    def river_laps(self) -> Array:
        """Duration of a lap of each river [s] of a field that gives the hand to one at a time; else empty."""
        choices = [law for law in self.parts.program.laws if isinstance(law, HigherOrder)]
        return np.array([curve.duration for curve in choices[0].curves] if len(choices) == 1 else [])

    @property
    def field(self) -> Law:
        """Law of force of the mode."""
        return self.parts.field

    @property
    def haptic_map(self) -> HapticMap:
        """The map of the figure, with gaze and lean if it has them."""
        return self.parts.maps.whole_map

    def loop(self, observe: Observer = ignore, block_seconds: float = BLOCK_SECONDS) -> Loop:
        """The run's loop, with its laws and its person's intent in Python, if it has any; see `sim.loop.loop.Loop`."""
        user, device, laws = self.parts.user, self.servo.device, self.parts.program.python_laws
        own = user.own if isinstance(user, Participant) else None
        if own is None or own.compiled or not isinstance(device, SimulatedPhantom):
            return Loop(self.servo, self.world, observe, block_seconds, laws)

        def ask(t: float) -> None:
            own.ask(device.user.person, t)

        return Loop(self.servo, self.world, observe, block_seconds, laws, ask=ask, ask_seconds=own.every)

    @property
    def _clip_names(self) -> str:
        """Names of the clips, or else the type of the map."""
        alone = "a robot arm" if self.world.kind == "robot" else type(self.haptic_map).__name__
        return ", ".join(clip.name for clip in self.clips) or alone

    @contextmanager
    def naming_laws(self) -> Generator[None]:
        """Context of ticks: after an error, the user-defined law that raises at the current hand state is named."""
        try:
            yield
        except Exception:
            hand = HandState.of(self.servo.device.hand)
            for law in self.parts.program.laws:
                if isinstance(law, CompiledLaw):
                    law.wrench(hand)
            raise

    def static(self) -> dict[str, npt.ArrayLike | str]:
        """Constant data that the recording keeps beside the channels."""
        phases, notes = np.linspace(self.curve.start, self.curve.end, COURSE_POINTS), self.parts.notes
        scene = self.world.config
        return {
            "curve": self.curve.point(phases),
            "curve_span": np.array([self.curve.start, self.curve.end]),
            "curve_closed": float(self.curve.periodic),
            "river_laps": self.river_laps,
            "tube_radius": notes.tube_radius,
            **({"tube_name": notes.tube_name} if notes.tube_name else {}),
            "distance_from": notes.distance_from,
            "hand_does": notes.hand_does,
            "p_WH": P_WH,
            "motor_continuous": np.array(PREMIUM_1_5.continuous_torque),
            "motor_peak": np.array(PREMIUM_1_5.peak_torque),
            "clip_seconds": self.parts.maps.lap_seconds,
            "clip_laps": self.parts.maps.lap_durations,
            "body_weight": self.weight,
            "com_height": standing_com(scene.stature, scene.mass),
            "scene": np.array([scene.stature, scene.mass, scene.servo_period, scene.physics_step]),
            "figure": self.world.kind,
            "title": f"{notes.title} over {self._clip_names}",
            "clip_names": "\n".join(clip.name for clip in self.clips),
            **{f"clip_{i}": clip.poses for i, clip in enumerate(self.clips)},
            "clip_fps": np.array([clip.fps for clip in self.clips]),
            **self.parts.maps.static,
            **notes.static,
            **recorded_as(self.config, self.servo.device),
        }

    @property
    def weight(self) -> float:
        """Weight of the figure, or of the robot arm [N]."""
        body = self.world.body
        return float(body.body_subtreemass[1]) * float(np.linalg.norm(body.opt.gravity))


def default_poses(session: Session, stride: int = 1) -> Callable[[Array, Array, Array], Array]:
    """A function from nearest points (k, 3), phases (k,) and rivers (k,) to poses (k, 75) of the default animation.

    It is called with rows in the order of time, `stride` figure updates apart.
    """
    if session.parts.maps.plays_rivers or session.parts.cross_track is not None:
        return _river_animation(session, stride)
    haptic_map = session.haptic_map
    memory = haptic_map.compiled().memory
    if session.parts.walking is not None:
        memory = walker_at.py_func(session.servo.field.walkers.state, 0).path.copy()

    def poses_at(nearest: Array, phases: Array, rivers: Array) -> Array:
        return map_poses(haptic_map, session.parts.argument_at(nearest, phases), memory)

    return poses_at


def _river_animation(session: Session, stride: int) -> Callable[[Array, Array, Array], Array]:
    """The same where rivers play clips of their own, with the changes from clip to clip as the figure made them."""
    period = stride * session.servo.figure_ticks * session.servo.plant.period
    compiled, part, figure = session.haptic_map.compiled(), session.config.figure, session.world.body
    reference = make_reference(
        figure, compiled, period, part.smoothing, part.blend, packed_legs(figure), cross_track=session.parts.cross_track
    )

    def poses_at(nearest: Array, phases: Array, rivers: Array) -> Array:
        traces = np.zeros((len(nearest), TRACE_SIZE))
        traces[:, TRACE_PHASE], traces[:, TRACE_RIVER] = phases, rivers
        poses = np.empty((len(nearest), session.haptic_map.nq))
        reference_along(reference, stylus_path(nearest), traces, poses)
        return poses

    return poses_at
