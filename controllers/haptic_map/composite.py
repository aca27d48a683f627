"""The red-blue composite map: legs of one clip, arms blended of two others (Donald & Henle 2000, Figs. 5 to 7)."""

from collections.abc import Sequence

from numba import njit

from controllers.blending.blend import blend
from controllers.curves.cylinder import AXIS, blend_weight, checked_interval, cylinder
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap, arms_of_others
from controllers.legs.limbs import Limb
from controllers.work_array import work_array
from geometry.arrays import Array

_CLIPS = 3
_R_MIN, _R_MAX, _SHARE, _BLEND = range(4)


@njit
def composite_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Composite`: h(x), and h_*(x) unless `jacobian` has no rows."""
    chain = work_array((3, 6))
    radius, angle = cylinder(x, chain)
    a, slope = blend_weight(radius, params[_R_MIN], params[_R_MAX])
    weights, changes = work_array((2, _CLIPS)), work_array((2, 3, _CLIPS))
    weights[:], changes[:] = 0.0, 0.0
    share = params[_SHARE]
    weights[0, 0], weights[1, 0], weights[1, 1], weights[1, 2] = 1.0, 1.0 - share, share * (1.0 - a), share * a
    changes[1, 1, 1], changes[1, 1, 2] = -share * slope, share * slope
    blend(params[_BLEND:], angle, weights, changes, chain, memory, pose, jacobian)


class Composite(AnimationMap):
    r"""The lower body of one clip, the upper body blended between two.

    θ = atan2(y, x) is the phase; the radius r blends red (inside) and blue (outside) with the weights 1 − u(r) and u(r)
    for the joints of the upper body, where u has eased ends (C²). Root and all other joints are those of the lower
    clip. Where the lower clip's legs cannot support all of red and blue, only a share λ of them is blended in
    (`with_share`). h does not depend on height or orientation of the stylus; on the axis r = 0 it is not defined.

    Parameters
    ----------
    lower, red, blue : (Array, float)
        Clips: poses (n, nq) and frames per second. Red and blue are aligned in time to the lower (`alignment`).
    upper_joints : sequence of int
        Joints of the upper body: joint k has the numbers 3 + 4k to 6 + 4k of a pose, the root is 0.
    r_range : tuple of two floats
        Interval [m] over which red turns to blue; r_min > 0.
    limbs : sequence of Limb
        Limbs of the lower body that stand (see `limb_kinematics`).
    lap : float, optional
        As in `Cylindrical`.
    apart : bool
        Whether strides of the clips need not be in step.

    Raises
    ------
    ParameterError
        If the clips' poses differ in size or lack these joints, a limb belongs to the upper body, or the interval is
        empty.
    """

    map_kernel = staticmethod(composite_map)
    share_at = _SHARE

    def __init__(
        self,
        lower: tuple[Array, float],
        red: tuple[Array, float],
        blue: tuple[Array, float],
        upper_joints: Sequence[int],
        r_range: tuple[float, float],
        limbs: Sequence[Limb] = (),
        lap: float | None = None,
        apart: bool = False,
    ) -> None:
        for limb in limbs:
            if set(limb.joints) & set(upper_joints):
                raise ParameterError(f"a limb of joints {limb.joints} shares some with the upper body's {upper_joints}")
        self.r_range, self.upper_joints = r_range, tuple(upper_joints)
        numbers = checked_interval("r_range", r_range, AXIS)
        super().__init__((lower, red, blue), (*numbers, 1.0), upper_joints, limbs, lap,
                         apart)  # fmt: skip

    @property
    def remarks(self) -> tuple[str, ...]:
        """A remark if only a share of red and blue is blended in."""
        if self.share == 1.0:
            return ()
        return (f"the lower body is combined with {arms_of_others(self.share)}",)

    @property
    def lap_durations(self) -> Array:
        """As in `AnimationMap`; only that of the lower clip if no other is blended in."""
        return super().lap_durations[: None if self.share > 0.0 else 1]

    @property
    def lap_seconds(self) -> float:
        """As in `AnimationMap`."""
        return self.loops[0].duration
