"""The configuration of a run: pure data, from which the command line is made and which is saved with the results."""

from dataclasses import dataclass, field
from typing import Literal

from experiments.config.options import above, at_least
from models.scene import SceneConfig
from sim.users.intent import Grab, Push, Turn

MAP_SUFFIX = ".npz"  # of a map's file
FIGURE_CLIPS = ("squat_dance", "cheer", "angry", "spin")
MAP_CLIPS = {"composite": ("squat_dance", "angry", "cheer"), "rivers": ("squat_dance", "cheer", "angry")}
STRETCHING = ("stretch", "stretch-then-follow")


@dataclass(frozen=True)
class RunConfig:
    """A run: with the seed, all that decides what happens.

    Parameters
    ----------
    clips : tuple of str
        Four motions for the corners of the map (inner low, outer low, inner high, outer high): names of embedded clips
        or files (BVH, AMC, DeepMimic). Fewer than four are repeated. For the composite map up to three: lower body,
        upper body inside, upper body outside; for the rivers' map one for each of the three rivers.
    mode : {"follow", "bunny", "rivers", "stretch", "stretch-then-follow", "lead"}
        Field of force. In the mode "lead" one clip walks where the hand leads it: the hand does so forward along an S,
        then straight back; map and user are then not chosen.
    map : str
        Haptic map: "cylindrical", four clips round a cylinder; "composite", the lower body of one clip and the upper
        body blended between two; "rivers", a clip for each river; or a map's file (.npz), which has its own clips.
    curve : str
        Of a lifted map, the curve that the run begins on, and that a single one follows: a clip's name or number; it
        is timed by the clip, so that `lap` and `radius` do not count. By default the first.
    expressive : bool
        Whether the figure looks where the stylus points and leans as it leans, in whatever map.
    user : {"relaxed", "trace", "push", "turn"}
        A hand that lets go, one that traces the curve by itself, one that pushes outwards and inwards once a lap, or
        one that turns the stylus: one lap to the left and right, one down and up, one over to either side.
    seconds : float
        Simulated time [s].
    seed : int
        Of where exactly the hand lets go of the stylus at the start.
    stiffness : float
        k_r of the field [N/m].
    damping : float
        b_d of the field [N s/m].
    river_stiffness, river_damping : float
        k_r and b_d of the rivers [N/m], [N s/m]. Softer and slower than one curve alone: so a push takes a hand over
        into another river before it throws it out of all.
    lifted_stiffness, lifted_damping : float
        k_r and b_d of the rivers of a map from a file [N/m], [N s/m]. These lie side by side: a hand that goes over
        from one to the other is drawn within τ = b_d/k_r, or the figure would have to be at the other clip's speed at
        once.
    tube : float
        Radius ε in which the field is felt [m].
    orientation_stiffness : float
        k_o of a moment that would turn the stylus to the curve's orientation [N m/rad]: it is recorded, but a device
        with three motors cannot give it.
    orientation_damping : float
        b_o of that moment [N m s/rad].
    bunny_width : float
        δ of the bunny [m].
    bunny_attraction : {"point", "along"}
        To the bunny itself, or along the curve.
    bunny_pace : {"clock", "wait"}
        Whether the bunny waits for the hand.
    river_tube : float
        Radius ε of the rivers [m].
    crossing : {"smooth", "discrete", "sum"}
        How crossing rivers share the hand: by its velocity, smoothly or with hysteresis, or not at all.
    blend : float
        In which one river's clip goes over into another's [s]; 0: the figure jumps.
    governor : bool
        Whether a hand too slow or too fast for the flights of the animation meets a force, and in rivers is not taken.
    governor_drag : float
        b of that force [N s/m].
    leash : float
        k_l, which keeps the hand from running ahead of a figure that is led [N/m].
    floor_scale : float, optional
        Metres of floor for one of the stylus, where a figure is led; by default such that it goes along the default S
        in five seconds.
    seek : float
        k_f, with which stretchy tubes draw the hand to the curve [N/m]; on a lifted map it is `lifted_stiffness`.
    rubber : float
        k_s of a held or pushed tube [N/m].
    rubber_tube : float
        Radius of the tube that can be held and pushed [m].
    walls : bool
        Let the hand feel the limits of the figure's joints, and of their speeds.
    wall_stiffness : float
        Of a joint beyond its limit [N m/rad].
    wall_margin : float
        Before a limit, where the wall begins [rad].
    joint_speed : float
        Greatest speed of a joint without resistance [rad/s].
    bump : float
        Half width of what a bend changes [s], at most half a lap.
    lap : float
        Time of a lap of the curve [s].
    radius : float
        Of the default curve, a circle about the vertical [m].
    reach : float
        Half width of the map's domain about the default curve, in radius and in height [m].
    cutoff : float
        Corner frequency of the velocity filter [Hz].
    smoothing : float
        Bandwidth of the filter between stylus and figure [Hz].
    figure_ticks : int
        Servo ticks between two updates of the figure; 0: 8, but 2 on a map from a file, on the map of rivers and of a
        figure that is led, whose clips are played as they are: a foot lands between two updates.
    scene : SceneConfig
        Figure's size, servo period and physics step.
    pushes : tuple of Push
        What the hand does; for the user "push" without any, outwards and inwards once a lap from the second lap on; on
        the rivers of a lifted map over to another clip at the best transition, and three laps later back.
    turns : tuple of Turn
        How it turns the stylus; with any it also holds it upright in between.
    grabs : tuple of Grab
        What it takes hold of; in the modes that stretch, by default, a tour of what can be done.
    """

    clips: tuple[str, ...] = ()
    mode: Literal["follow", "bunny", "rivers", "stretch", "stretch-then-follow", "lead"] = "follow"
    map: str = "cylindrical"
    curve: str = ""
    expressive: bool = False
    user: Literal["relaxed", "trace", "push", "turn"] = "relaxed"
    seconds: float = above(0.0, 20.0, "s")
    seed: int = at_least(0, 1)
    stiffness: float = at_least(0.0, 300.0, "N/m")
    damping: float = at_least(0.0, 8.0, "N s/m")
    river_stiffness: float = above(0.0, 150.0, "N/m")
    river_damping: float = above(0.0, 16.0, "N s/m")
    lifted_stiffness: float = above(0.0, 50.0, "N/m")
    lifted_damping: float = above(0.0, 20.0, "N s/m")
    tube: float = at_least(1e-4, 0.25, "m", infinite=True)
    orientation_stiffness: float = at_least(0.0, 0.0, "N m/rad")
    orientation_damping: float = at_least(0.0, 0.0, "N m s/rad")
    bunny_width: float = at_least(1e-4, 0.05, "m")
    bunny_attraction: Literal["point", "along"] = "point"
    bunny_pace: Literal["clock", "wait"] = "wait"
    river_tube: float = at_least(1e-4, 0.015, "m")
    crossing: Literal["smooth", "discrete", "sum"] = "discrete"
    blend: float = at_least(0.0, 0.4, "s")
    governor: bool = False
    governor_drag: float = at_least(0.0, 8.0, "N s/m")
    leash: float = at_least(0.0, 120.0, "N/m")
    floor_scale: float | None = at_least(1e-3, None)
    seek: float = at_least(0.0, 150.0, "N/m")
    rubber: float = at_least(0.0, 150.0, "N/m")
    rubber_tube: float = at_least(1e-4, 0.008, "m")
    walls: bool = False
    wall_stiffness: float = at_least(0.0, 0.1, "N m/rad")
    wall_margin: float = at_least(1e-6, 0.09, "rad")
    joint_speed: float = at_least(1e-6, 20.0, "rad/s", infinite=True)
    bump: float = above(0.0, 0.5, "s")
    lap: float = above(0.0, 4.0, "s")
    radius: float = above(0.0, 0.0477, "m")
    reach: float = above(0.0, 0.025, "m")
    cutoff: float = above(0.0, 150.0, "Hz")
    smoothing: float = above(0.0, 6.0, "Hz")
    figure_ticks: int = at_least(0, 0)
    scene: SceneConfig = field(default_factory=SceneConfig)
    pushes: tuple[Push, ...] = ()
    turns: tuple[Turn, ...] = ()
    grabs: tuple[Grab, ...] = ()

    def __post_init__(self) -> None:
        if not self.clips:
            clips = ("walk",) if self.mode == "lead" else MAP_CLIPS.get(self.map, FIGURE_CLIPS)
            object.__setattr__(self, "clips", clips)
        if self.figure_ticks == 0:
            lands = self.mode == "lead" or self.map == "rivers" or self.map.endswith(MAP_SUFFIX)
            object.__setattr__(self, "figure_ticks", 2 if lands else 8)

    @property
    def gains(self) -> tuple[float, float]:
        """k_r [N/m] and b_d [N s/m] of the mode's field."""
        if self.mode == "rivers" and self.map.endswith(MAP_SUFFIX):
            return self.lifted_stiffness, self.lifted_damping
        if self.mode == "rivers":
            return self.river_stiffness, self.river_damping
        return self.stiffness, self.damping


@dataclass(frozen=True)
class ArmConfig:
    """A run of the robot arm: with the seed, all that decides what happens.

    Parameters
    ----------
    user : {"relaxed", "push"}
        A hand that lets go, or one that pushes outwards and inwards once in the second lap.
    seconds : float
        Simulated time [s].
    seed : int
        Of where exactly the hand lets go of the stylus at the start.
    stiffness, damping, tube : float
        k_r [N/m], b_d [N s/m] and ε [m] of FOLLOW.
    lap, radius : float
        Time [s] and radius [m] of the curve, a tilted circle.
    cutoff : float
        Corner frequency of the velocity filter [Hz].
    smoothing : float
        Bandwidth of the filter between stylus and arm [Hz].
    arm_ticks : int
        Servo ticks between two updates of the arm's torques.
    scene : SceneConfig
        Servo period and physics step.
    """

    user: Literal["relaxed", "push"] = "push"
    seconds: float = at_least(1.5, 12.0, "s")
    seed: int = at_least(0, 1)
    stiffness: float = at_least(0.0, 300.0, "N/m")
    damping: float = at_least(0.0, 8.0, "N s/m")
    tube: float = at_least(1e-4, 0.25, "m", infinite=True)
    lap: float = above(0.0, 4.0, "s")
    radius: float = above(0.0, 0.05, "m")
    cutoff: float = above(0.0, 150.0, "Hz")
    smoothing: float = above(0.0, 6.0, "Hz")
    arm_ticks: int = at_least(1, 4)
    scene: SceneConfig = field(default_factory=SceneConfig)
