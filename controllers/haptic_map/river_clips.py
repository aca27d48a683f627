"""The map of a bundle of rivers: the active river selects the clip, the hand's phase on its curve the frame."""

from collections.abc import Sequence
from copy import copy

import numpy as np
from numba import njit

from controllers.blending.blend import blend
from controllers.curves.trajectory import START, Trajectory, curve_acceleration, curve_point, curve_velocity
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap
from controllers.haptic_map.clip_change import ClipChange, add_change, packed_changes, transition_duration
from controllers.haptic_map.river_memory import (
    ACTIVE_RIVER,
    BLEND,
    CLIP_PHASE,
    CURVES,
    GATE_PHASE,
    HAND_PHASE,
    HELD,
    LEAD,
    RIVERS,
    TRANSITION,
    changes_of,
    in_round,
    lead_of,
    phase_near,
    round_of,
    time_after,
    timing_curve,
)
from controllers.legs.limbs import Limb
from controllers.motion.lap import MEMORY
from controllers.state import Pose
from controllers.work_array import work_array
from geometry.arrays import Array

MAX_CHANGE_FRACTION = 0.7  # longest duration of a change, as a fraction of a round
_LAP_TOLERANCE = 1e-6  # [s] largest difference between the laps of two rivers that have a change between them


@njit
def river_clips_map(params: Array, x: Array, memory: Array, pose: Pose, jacobian: Array) -> None:
    """Kernel of `RiverClips`: h(x), and h_*(x) unless `jacobian` has no rows."""
    river, rivers = int(memory[ACTIVE_RIVER]), int(params[RIVERS])
    curve = timing_curve(params, memory)
    phase = memory[HAND_PHASE] if memory[HELD] > 0.0 else phase_near(params, curve, x, memory[HAND_PHASE])
    start, period = params[curve + START], round_of(params, curve)
    pace, rate, shown = 2.0 * np.pi / period, 1.0, phase
    memory[HAND_PHASE] = phase
    if memory[LEAD] != 0.0:
        lead, decay = lead_of(params, memory, phase)
        shown, rate = in_round(params, curve, phase + lead), rate + decay
        memory[LEAD] = memory[LEAD] if abs(lead) > 0.0 else 0.0
    memory[CLIP_PHASE] = shown
    known, change, since = changes_of(params), int(memory[TRANSITION]), 0.0
    if change >= 0:
        since = time_after(shown - start, memory[GATE_PHASE], period)
        memory[TRANSITION] = memory[TRANSITION] if since < transition_duration(known, change) else -1.0
    point, tangent = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    bend = curve_acceleration(params, curve, phase)
    # Differentiating (φ − p)·φ̇ = 0 at the nearest point gives dt*/dp = φ̇ / (|φ̇|² + (φ − p)·φ̈).
    slope = 0.0
    for i in range(3):
        slope += tangent[i] ** 2 + (point[i] - x[i]) * bend[i]
    chain = work_array((3, 6))
    chain[:] = 0.0
    for i in range(3):
        chain[0, i] = rate * pace * tangent[i] / slope if slope > 0.0 and memory[HELD] == 0.0 else 0.0
    weights, changes = work_array((1, rivers)), work_array((1, 3, rivers))
    weights[:], changes[:] = 0.0, 0.0
    weights[0, river] = 1.0
    angle = pace * (shown - start)
    blend(params[int(params[BLEND]) :], angle, weights, changes, chain, memory[:MEMORY], pose, jacobian)
    if change >= 0:
        for i in range(6):
            chain[0, i] /= pace
        add_change(known, change, since, chain[0], pose, jacobian)


class RiverClips(AnimationMap):
    r"""One clip for each river of a bundle.

    .. math:: h(p, i, k) = A\,\rho_i\Bigl(\frac{2\pi}{m} \Bigl(k + \frac{t^*_i - t_0}{t_1 - t_0}\Bigr)\Bigr)

    i is the active river, whose number the field writes to its trace; t*_i is the phase of its curve nearest to the
    stylus (if there are several branches, on the one that continues the last phase). A round of m laps of the river is
    a lap of its clip, and k is the lap of the round that the hand is in: it follows by continuity, and k = 0 at first.
    If no river is active, and the hand is outside the tube of the last one or too fast in it, no frame is played: the
    reference stops at a phase at which the clip can stand (`stop_clip`). The phase that is shown leads or lags behind
    the hand's after a change of river, and while the hand is faster than its river (`river_memory.absorb_excess_pace`).

    Clips are aligned in time to the first (`alignment`), so that a change keeps about the same phase of motion. A ∈
    SE(2) is the frame of the lap, stored in the memory (`lap`). When the river changes, h jumps, and the reference
    continues from where the figure stands (`place_clip`) with a decaying offset (`inertialization`). Where a change
    between the two clips is precomputed (`clip_change`), it begins at the next gate instead, and h runs through it with
    the phase of the hand. h does not depend on the stylus's orientation.

    Parameters
    ----------
    curves : sequence of Trajectory
        Curves of the rivers, periodic, in H.
    clips : sequence of (Array, float)
        One for each curve: poses (n, nq) and frames per second. Clips that do not close are closed (`closed_loop`).
    tube : float
        Distance from a curve [m] within which a branch is followed; beyond it the nearest point of all counts.
    limbs : sequence of Limb
        Limbs whose ends (feet) are placed (see `limb_kinematics`).
    lap : float, optional
        Duration of a round [s], in which each clip is played as often as it fits (`strides`); by default once.
    apart : bool
        Whether strides of the clips need not be in step.
    laps : int
        m, laps of the hand in a round.

    Raises
    ------
    ParameterError
        If clips and curves differ in number, a curve is open, the tube is not positive, or the clips' poses differ in
        size; if there is less than one lap.
    """

    map_kernel = staticmethod(river_clips_map)

    def __init__(
        self,
        curves: Sequence[Trajectory],
        clips: Sequence[tuple[Array, float]],
        tube: float,
        limbs: Sequence[Limb] = (),
        lap: float | None = None,
        apart: bool = False,
        laps: int = 1,
    ) -> None:
        if len(clips) != len(curves) or not curves:
            raise ParameterError(
                f"a map of rivers needs a clip for each; got {len(clips)} clips and {len(curves)} rivers"
            )
        opened = [i for i, curve in enumerate(curves) if not curve.periodic]
        if opened:
            raise ParameterError(f"a river that plays a clip must be a closed curve; river {opened[0]} is open")
        if not tube > 0.0:
            raise ParameterError(f"the tube of a map of rivers must be positive, got {tube} m")
        if laps < 1:
            raise ParameterError(f"a round of rivers has one lap or more, got {laps}")
        self.curves, self._laps, self._tube = tuple(curves), laps, tube
        self._rest_phases: tuple[Array, ...] = (np.zeros(0),) * len(curves)
        self.changes: tuple[ClipChange, ...] = ()
        super().__init__(clips, self._header(), (), limbs, lap, apart)

    def _header(self) -> Array:
        """Parameters of the kernel before those of the blend."""
        blocks = [*(curve.packed() for curve in self.curves), *self._rest_phases, packed_changes(self.changes)]
        offsets = np.cumsum([CURVES + len(blocks) + 1, *(len(block) for block in blocks)])
        return np.concatenate([[len(self.curves), self._tube, self.laps, offsets[-1]], offsets, *blocks])

    @property
    def laps(self) -> int:
        """m, laps of the hand in a round, in which each clip is played a whole number of times."""
        return self._laps

    def round_seconds(self, river: int) -> float:
        """Duration of a round of a river [s]."""
        return self.laps * self.curves[river].duration

    def with_rest_phases(self, rests: Sequence[Array]) -> "RiverClips":
        """The same map with clips that stop only at given phases [s] of the round, (n,) per curve; empty: anywhere.

        Raises
        ------
        ParameterError
            If phases and curves differ in number, or a phase is not finite.
        """
        phases = [np.asarray(still, dtype=np.float64).ravel() for still in rests]
        if len(phases) != len(self.curves) or not all(np.all(np.isfinite(still)) for still in phases):
            raise ParameterError(f"expected finite phases of rest for each of {len(self.curves)} rivers, got {rests}")
        other = copy(self)
        other._rest_phases = tuple(phases)
        return other._repack()

    def with_changes(self, changes: Sequence[ClipChange]) -> "RiverClips":
        """The same map with precomputed changes between its clips.

        Raises
        ------
        ParameterError
            If a change names a river that does not exist, or rivers with different laps, has no gate, does not fit
            the poses, or lasts longer than 0.7 of a round.
        """
        laps = [curve.duration for curve in self.curves]
        for change in changes:
            name = f"the change from river {change.first} to {change.second}"
            if not {change.first, change.second} <= set(range(len(laps))) or change.first == change.second:
                raise ParameterError(f"{name} is not between two of {len(laps)} rivers")
            if abs(laps[change.first] - laps[change.second]) > _LAP_TOLERANCE:
                raise ParameterError(f"{name} is between laps of {laps[change.first]} and {laps[change.second]} s")
            if not len(change.gates) or change.offsets.shape[1:] != (3 + 3 * ((self.nq - 3) // 4),):
                raise ParameterError(f"{name} has {len(change.gates)} gates and offsets {change.offsets.shape}")
            if not 0.0 < change.seconds < MAX_CHANGE_FRACTION * self.round_seconds(change.first):
                period = self.round_seconds(change.first)
                raise ParameterError(f"{name} lasts {change.seconds:.2f} s of a round of {period:.2f} s")
        other = copy(self)
        other.changes = tuple(changes)
        return other._repack()

    def on_one_river(self) -> "RiverClips":
        """The same clips with the first river's curve for all, so that a change affects only the motion."""
        other = copy(self)
        other.curves = (self.curves[0],) * len(self.curves)
        return other._repack()

    def _repack(self) -> "RiverClips":
        self._params = np.concatenate([self._header(), self._params[int(self._params[BLEND]) :]])
        return self

    def fresh_memory(self) -> Array:
        """As in `ClipMap`, and the change of clips: the first river is active."""
        memory = [0.0, np.nan, 0.0, 0.0, 0.0, 0.0, np.nan, -1.0, 0.0, np.nan]
        return np.concatenate([super().fresh_memory(), memory])
