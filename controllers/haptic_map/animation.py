"""Base classes of the maps that blend clips: clips become loops, and a lap of the hand plays a lap of every clip."""

from collections.abc import Sequence
from copy import copy
from functools import lru_cache
from typing import ClassVar, NamedTuple, Self

import numpy as np

from controllers.blending.blend import packed_blend
from controllers.blending.clip_arrays import clip_arrays
from controllers.blending.combination import fresh_lap
from controllers.errors import ParameterError
from controllers.haptic_map.base import KernelMap
from controllers.legs.limbs import Limb
from controllers.motion.loops import Loop, checked_clip, closed_loop
from controllers.motion.strides import fit_to_lap
from geometry.arrays import Array


class ClipMap(KernelMap):
    """A map whose kernel computes poses from clips, and whose memory is the frame of the lap.

    Parameters
    ----------
    params
        As in `KernelMap`.
    clips : sequence of (Array, float)
        Clips that the map is made of: poses (n, nq) and frames per second.
    limbs : sequence of Limb
        Limbs whose ends (feet) are placed at the mean of their positions in the clips (see `limb_kinematics`).
    """

    def __init__(self, params: Array, clips: Sequence[tuple[Array, float]], limbs: Sequence[Limb]) -> None:
        super().__init__(params)
        # Stored as given, so that a map rebuilt from them is the same bit for bit.
        self.clips = tuple((np.array(poses, dtype=np.float64), float(fps)) for poses, fps in clips)
        self.limbs = tuple(limbs)

    @property
    def nq(self) -> int:
        """Numbers of a configuration."""
        return self.clips[0][0].shape[1]

    @property
    def lap_seconds(self) -> float:
        """Duration of a lap at which the clips run on average at their own pace [s]."""
        return float(np.mean([(len(poses) - 1) / fps for poses, fps in self.clips]))

    def fresh_memory(self) -> Array:
        """The memory of a new run: the frame of its first lap."""
        return fresh_lap()


class _Ingredients:
    """All that a blend is made of, equal to others of the same numbers."""

    def __init__(
        self, clips: Sequence[tuple[Array, float]], second_group: tuple[int, ...], limbs: Sequence[Limb],
        lap: float | None, apart: bool,
    ) -> None:  # fmt: skip
        self.clips, self.second_group, self.limbs, self.lap, self.apart = clips, second_group, limbs, lap, apart
        arrays = clip_arrays(clips, range(len(clips)), limbs).items()
        self._numbers = second_group, lap, apart, tuple((key, array.shape, array.tobytes()) for key, array in arrays)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Ingredients) and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(self._numbers)


class _Blended(NamedTuple):
    """Clips as loops, limbs with limits that include all poses, and parameters of `blend`."""

    loops: list[Loop]
    limbs: list[Limb]
    params: Array


@lru_cache(maxsize=8)  # the runs of a sweep, a study or a live page blend the same clips
def _blended(of: _Ingredients) -> _Blended:
    poses = [checked_clip(clip, fps, f"clip {i}") for i, (clip, fps) in enumerate(of.clips)]
    if len({clip.shape[1] for clip in poses}) != 1:
        raise ParameterError(f"all clips must have poses of the same size, got {[clip.shape[1] for clip in poses]}")
    loops = [closed_loop(clip, fps) for clip, (_, fps) in zip(poses, of.clips, strict=True)]
    loops = fit_to_lap(loops, of.lap, of.apart)
    limbs = [limb.with_limits_for(poses) for limb in of.limbs]
    groups = np.zeros((poses[0].shape[1] - 3) // 4, dtype=np.int64)
    for joint in of.second_group:
        if not 1 <= joint < len(groups):
            raise ParameterError(f"the poses have joints 1 to {len(groups) - 1}, a group needs {joint}")
        groups[joint] = 1
    frames = max(loop.share * (len(loop.splines[0].x) - 1) for loop in loops)
    samples = int(np.clip(np.ceil(frames), 64, 2048))
    return _Blended(loops, limbs, packed_blend(loops, samples, groups, limbs))


class AnimationMap(ClipMap):
    """A map whose poses are blends of clips that were closed and aligned.

    Parameters
    ----------
    clips : sequence of (Array, float)
        Poses (n, nq) and frames per second; a pose is root position, root quaternion, then joint quaternions (wxyz).
        Clips that do not close are closed (`closed_loop`), travelling ones brought in step (`strides`), and all
        are aligned to the first in time (`alignment`).
    numbers : sequence of float
        Parameters of the kernel before those of the blend.
    second_group : sequence of int
        Joints, counted from 1, that are blended with the second group of weights.
    limbs : sequence of Limb
        Limbs whose ends (feet) are placed at the mean of their positions in the clips (see `limb_kinematics`).
    lap : float, optional
        Duration of the hand's lap [s], in which each clip is played as often as it fits (`strides`); by default once.
    apart : bool
        Whether the legs are those of one clip, so that strides of the clips need not be in step.

    Raises
    ------
    ParameterError
        If the clips' poses differ in size, or lack joints of a limb or of the second group.

    Attributes
    ----------
    share : float
        λ, share of the other clips that is blended into the second group; `share_at` is its place among the numbers.
    """

    share: float = 1.0
    share_at: ClassVar[int]

    def __init__(
        self,
        clips: Sequence[tuple[Array, float]],
        numbers: Sequence[float] | Array,
        second_group: Sequence[int],
        limbs: Sequence[Limb],
        lap: float | None = None,
        apart: bool = False,
    ) -> None:
        self.lap, self.second_group = lap, tuple(second_group)
        blended = _blended(_Ingredients(clips, self.second_group, limbs, lap, apart))
        self.loops: list[Loop] = list(blended.loops)
        super().__init__(np.concatenate([numbers, blended.params]), clips, blended.limbs)

    @property
    def laps(self) -> int:
        """Laps of the hand in which each clip is played a whole number of times."""
        return 1

    @property
    def lap_durations(self) -> Array:
        """Durations of a lap at which each clip that is played, with its repeats, runs at its own pace [s]."""
        return np.array([loop.duration for loop in self.loops]) / self.laps

    @property
    def lap_seconds(self) -> float:
        """Duration of a lap at which the clips of the legs run on average at their own pace [s]."""
        return float(np.mean(self.lap_durations))

    def with_share(self, share: float) -> Self:
        """The same map with another share λ of the others' joints: 0 plays the clip of the legs alone.

        Raises
        ------
        ParameterError
            If the share is not from 0 to 1, or all joints are blended.
        """
        if not (self.second_group and 0.0 <= share <= 1.0):
            raise ParameterError(f"a map with legs of one clip takes a share of other joints from 0 to 1, got {share}")
        other = copy(self)
        other._params = self._params.copy()
        other._params[self.share_at] = other.share = share
        return other


def arms_of_others(share: float) -> str:
    """In words, at the end of a remark, which share of the others' arm motion is combined with one clip's legs."""
    alone = "" if share > 0.0 else ": one clip plays alone, and the hand changes nothing but its pace"
    return "the others' arm motion" if share == 1.0 else f"{100 * share:.0f} % of the others' arm motion{alone}"
