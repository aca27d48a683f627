"""Fields of force that a run can have, one dataclass for each mode."""

from typing import Annotated, Literal

from pydantic import Field

from controllers.certificates.loop.hand import MAX_DAMPING, MAX_STIFFNESS
from controllers.errors import ParameterError
from experiments.config.part import above, at_least, part


@part
class OrientationMoment:
    """Moment that turns the stylus as the curve is turned.

    Parameters
    ----------
    orientation_stiffness : float
        Stiffness of the moment towards the curve's orientation [N m/rad].
    orientation_damping : float
        Damping of the stylus's rotation relative to the curve's [N m s/rad].
    """

    orientation_stiffness: float = at_least(0.0, default=0.0, unit="N m/rad")
    orientation_damping: float = at_least(0.0, default=0.0, unit="N m s/rad")


@part
class SpeedGovernor:
    """Force on a hand that goes too slowly or too fast for the flights of the animation; rivers are gated.

    Parameters
    ----------
    governor_drag : float
        Drag on the hand's speed beyond what is admissible [N s/m].
    """

    governor_drag: float = at_least(0.0, default=8.0, unit="N s/m", most=MAX_DAMPING)


NO_DRAG = (
    "--governor-drag has no meaning with --mode rivers, whose governor gates each river; it belongs to --crossing sum, "
    "and to --mode follow, bunny"
)


def gates_rivers(crossing: str) -> bool:
    """Whether a governor of rivers gates them, rather than being a drag."""
    return crossing != "sum"


@part
class JointWalls:
    """Limits of the figure's joints, and of their speeds, that the hand feels.

    Parameters
    ----------
    wall_stiffness : float
        Stiffness of a joint beyond its limit [N m/rad].
    wall_margin : float
        Distance before a limit at which the wall begins [rad].
    joint_speed : float
        Largest speed of a joint without resistance [rad/s].
    """

    wall_stiffness: float = at_least(0.0, default=0.1, unit="N m/rad")
    wall_margin: float = at_least(1e-6, default=0.09, unit="rad")
    joint_speed: float = at_least(1e-6, default=20.0, unit="rad/s", infinite=True)


@part
class Follow:
    """A spring to the curve and a damper to its tangent velocity.

    Parameters
    ----------
    stiffness : float
        k_r [N/m].
    damping : float
        b_d [N s/m].
    tube : float
        ε, beyond which the field ends [m].
    flow : {"curve", "parallel"}
        Velocity off the curve: the curve's, or that of its parallel, with which a hand that is pushed off keeps the
        curve's pace, by default on composites and maps from a file.
    orientation, governor, walls
        What is added, if anything.
    """

    kind: Literal["follow"] = "follow"
    stiffness: float = at_least(0.0, default=300.0, unit="N/m", most=MAX_STIFFNESS)
    damping: float = at_least(0.0, default=8.0, unit="N s/m", most=MAX_DAMPING)
    tube: float = at_least(1e-4, default=0.25, unit="m", infinite=True)
    flow: Literal["curve", "parallel"] | None = None
    orientation: OrientationMoment | None = None
    governor: SpeedGovernor | None = None
    walls: JointWalls | None = None


@part
class Bunny:
    """An attractor that runs along the curve, felt only near it.

    Parameters
    ----------
    stiffness : float
        k_r [N/m].
    damping : float
        b_d [N s/m].
    bunny_width : float
        δ of its Gaussian [m].
    bunny_attraction : {"point", "along", "convolution"}
        Towards the bunny itself, the curve beside the hand, or the bunny convolved with a Gaussian, as in the paper.
    bunny_pace : {"clock", "wait"}
        Whether it keeps the clock's pace, or waits for the hand.
    orientation, governor, walls
        What is added, if anything.
    """

    kind: Literal["bunny"] = "bunny"
    stiffness: float = at_least(0.0, default=300.0, unit="N/m", most=MAX_STIFFNESS)
    damping: float = at_least(0.0, default=8.0, unit="N s/m", most=MAX_DAMPING)
    bunny_width: float = at_least(1e-4, default=0.05, unit="m")
    bunny_attraction: Literal["point", "along", "convolution"] = "point"
    bunny_pace: Literal["clock", "wait"] = "wait"
    orientation: OrientationMoment | None = None
    governor: SpeedGovernor | None = None
    walls: JointWalls | None = None


@part
class Rivers:
    """Several crossing rivers, of which one acts on the hand.

    Parameters
    ----------
    stiffness : float, optional
        k_r [N/m]; by default 150, softer than one curve alone, so that a push takes a hand over into another river
        before it throws it out of all; 50 on a map from a file, whose rivers lie side by side.
    damping : float, optional
        b_d [N s/m]; by default 16, and 20 on a map from a file.
    river_tube : float
        ε of each river [m].
    crossing : {"smooth", "discrete", "sum"}
        How rivers share a hand where they cross.
    orientation, governor, walls
        What is added, if anything. With a governor each river is gated: it takes no hand that is too slow or too fast
        for its flights; only where the rivers' forces are summed, there is a drag instead.
    """

    kind: Literal["rivers"] = "rivers"
    stiffness: float | None = above(0.0, default=None, unit="N/m", most=MAX_STIFFNESS)
    damping: float | None = above(0.0, default=None, unit="N s/m", most=MAX_DAMPING)
    river_tube: float = at_least(1e-4, default=0.015, unit="m")
    crossing: Literal["smooth", "discrete", "sum"] = "discrete"
    orientation: OrientationMoment | None = None
    governor: SpeedGovernor | None = None
    walls: JointWalls | None = None

    def __post_init__(self) -> None:
        if self.governor not in (None, SpeedGovernor()) and gates_rivers(self.crossing):
            raise ParameterError(NO_DRAG)


@part
class StretchyTube:
    """Base of modes whose curve is held and bent; its parameters are described in `Stretch`."""

    kind: str
    seek: float | None = at_least(0.0, default=None, unit="N/m", most=MAX_STIFFNESS)
    rubber: float = at_least(0.0, default=150.0, unit="N/m", most=MAX_STIFFNESS)
    tube_damping: float | None = at_least(0.0, default=None, unit="N s/m", most=MAX_DAMPING)
    rubber_from: Literal["curve", "stylus"] = "curve"
    rubber_tube: float = at_least(1e-4, default=0.008, unit="m")
    bump: float | None = above(0.0, default=None, unit="s")
    walls: JointWalls | None = None


@part
class Stretch(StretchyTube):
    """A curve that attracts the hand, can be grabbed and bends like rubber.

    Parameters
    ----------
    seek : float, optional
        k_f, with which the tube draws the hand to the curve [N/m]; by default 150, and 50 on a map from a file.
    rubber : float
        k_s of a held or pushed tube [N/m].
    tube_damping : float, optional
        Damping of the search and of the tube [N s/m]; by default 14, and 20 on a map from a file.
    rubber_from : {"curve", "stylus"}
        Where a held tube pulls to: the point of the curve that was grabbed, or, as in the paper, the position of the
        stylus at that moment.
    rubber_tube : float
        Radius of the tube that can be held and pushed [m].
    bump : float, optional
        Half width of what a bend changes [s], at most half a lap; by default an eighth of a lap, but at least 0.5 s.
    walls
        What is added, if anything.
    """

    kind: Literal["stretch"] = "stretch"


@part
class StretchThenFollow(StretchyTube):
    """A curve that is bent, and performed by FOLLOW when the hand has finished.

    Parameters
    ----------
    seek, rubber, tube_damping, rubber_from, rubber_tube, bump
        As in `Stretch`.
    stiffness, damping, tube
        Of the performance, as in `Follow`.
    walls
        What is added, if anything.
    """

    kind: Literal["stretch-then-follow"] = "stretch-then-follow"
    stiffness: float = at_least(0.0, default=300.0, unit="N/m", most=MAX_STIFFNESS)
    damping: float = at_least(0.0, default=8.0, unit="N s/m", most=MAX_DAMPING)
    tube: float = at_least(1e-4, default=0.25, unit="m", infinite=True)


@part
class Lead:
    """The stylus leads a walking figure.

    Parameters
    ----------
    leash : float
        k_l, of the force that keeps the hand from running ahead [N/m].
    damping : float
        Damping of the hand [N s/m].
    floor_scale : float, optional
        Metres of floor per metre of the stylus [1]; by default such that the figure goes along the default S in 5 s,
        or longer if the gait is slow for its strides.
    """

    kind: Literal["lead"] = "lead"
    leash: float = at_least(0.0, default=120.0, unit="N/m", most=MAX_STIFFNESS)
    damping: float = at_least(0.0, default=8.0, unit="N s/m", most=MAX_DAMPING)
    floor_scale: float | None = at_least(1e-3, default=None, most=1e4)


Mode = Annotated[Follow | Bunny | Rivers | Stretch | StretchThenFollow | Lead, Field(discriminator="kind")]
MODES = (Follow, Bunny, Rivers, Stretch, StretchThenFollow, Lead)
