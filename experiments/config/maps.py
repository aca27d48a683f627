"""Haptic maps that a run can have, one dataclass for each kind."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.config.part import above, at_least, part


@part
class Circle:
    """The default curve: a circle about the vertical axis of the hand frame.

    Parameters
    ----------
    lap : float, optional
        Time of a lap [s], at most a day; in less than a tenth of a second no hand completes one. By default 4 s, or, if
        the map plays motion files, the lap in which its clips play nearest to their own pace.
    radius : float
        Radius of the circle [m].
    wave : float
        How far it goes up and down, three times a lap, so that every joint of the device turns [m].
    """

    lap: float | None = at_least(0.1, default=None, unit="s", most=86_400.0)
    radius: float = above(0.0, default=0.0477, unit="m")
    wave: float = at_least(0.0, default=0.0, unit="m")


@part
class Cylindrical:
    """Four clips at the corners of a cylinder: the angle is the frame, radius and height blend.

    Parameters
    ----------
    clips : tuple of str
        Inner low, outer low, inner high, outer high: names of embedded clips, or motion files; fewer are repeated. A
        composite takes up to three: legs, upper body inside, outside; rivers up to one each, LEADING one.
    around : Circle
        The curve.
    reach : float
        Half width of the map's domain about the curve, in radius and in height [m].
    expressive : bool
        Whether the figure looks where the stylus points, and leans as it leans.
    raw : bool
        Whether motion files are taken as captured; by default they are prepared once, as by `hvf prepare`.
    """

    kind: Literal["cylindrical"] = "cylindrical"
    clips: tuple[str, ...] = ("squat_dance", "cheer", "angry", "spin")
    raw: bool = False
    around: Circle = Circle()
    reach: float = above(0.0, default=0.025, unit="m")
    expressive: bool = False


@part
class Composite:
    """The lower body of one clip, the upper body blended between two.

    Parameters
    ----------
    clips : tuple of str
        Lower body, upper body inside, upper body outside; fewer are repeated.
    around, reach, expressive
        As in `Cylindrical`.
    raw : bool
        As in `Cylindrical`.
    """

    kind: Literal["composite"] = "composite"
    clips: tuple[str, ...] = ("squat_dance", "angry", "cheer")
    raw: bool = False
    around: Circle = Circle()
    reach: float = above(0.0, default=0.025, unit="m")
    expressive: bool = False


@part
class RiverClips:
    """A clip for each of the three rivers.

    Parameters
    ----------
    clips : tuple of str
        Of the level river, the wave, and the high one; fewer are repeated.
    around, reach, expressive
        As in `Cylindrical`.
    raw : bool
        As in `Cylindrical`.
    """

    kind: Literal["rivers"] = "rivers"
    clips: tuple[str, ...] = ("squat_dance", "cheer", "angry")
    raw: bool = False
    around: Circle = Circle()
    reach: float = above(0.0, default=0.025, unit="m")
    expressive: bool = False


class _WithoutClips:
    """Base of maps that name no clips."""

    @property
    def clips(self) -> tuple[str, ...]:
        """Empty: a file has clips of its own, and an arm plays none."""
        return ()

    @property
    def raw(self) -> bool:
        """There is nothing to prepare."""
        return True


@part
class MapFile(_WithoutClips):
    """A lifted map from a file, with clips and curves of its own.

    Parameters
    ----------
    file : str
        The file (.npz).
    curve : str
        Curve on which the run begins, and which a single one follows: a clip's name or number; by default the first.
        It is timed by the clip.
    around : Circle
        The default: the map has curves of its own.
    reach, expressive
        As in `Cylindrical`.
    """

    kind: Literal["file"] = "file"
    file: str
    curve: str = ""
    around: Circle = Circle()
    reach: float = above(0.0, default=0.025, unit="m")
    expressive: bool = False


@part
class RobotArm(_WithoutClips):
    """A robot arm of seven joints in the place of the figure: its tool follows the stylus.

    Parameters
    ----------
    around : Circle
        The curve, a circle that is then tilted towards the user.
    reach : float
        As in `Cylindrical`.
    scale : float
        Ratio of the tool's motion to the stylus's [1].
    """

    kind: Literal["robot-arm"] = "robot-arm"
    around: Circle = Circle()
    reach: float = above(0.0, default=0.025, unit="m")
    scale: float = above(0.0, default=1.5)


@part
class Led:
    """The clip of a figure that is led.

    Parameters
    ----------
    clips : tuple of str
        One clip that travels.
    raw : bool
        As in `Cylindrical`.
    """

    kind: Literal["led"] = "led"
    clips: tuple[str, ...] = ("walk",)
    raw: bool = False


Map = Annotated[Cylindrical | Composite | RiverClips | MapFile | RobotArm | Led, Field(discriminator="kind")]
MAPS = (Cylindrical, Composite, RiverClips, MapFile, RobotArm)
MAP_SUFFIX = ".npz"
