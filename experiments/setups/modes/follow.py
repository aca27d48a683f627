"""Set-up of the mode "follow": FOLLOW along a curve."""

from controllers.fields.follow import PACE_RANGE
from controllers.fields.follow import Follow as FollowLaw
from controllers.safety.energy_tank import river_power
from experiments.config.modes import Follow
from experiments.config.run_config import RunConfig
from experiments.setups.modes.fixed_curve import FixedField, fixed_curve_parts
from experiments.setups.parts.budget import fastest
from experiments.setups.parts.governor import governed
from experiments.setups.parts.pace import compensation, course_of
from experiments.setups.parts.part_types import ClipMapParts, Notes, Parts


def follow_parts(config: RunConfig, mode: Follow, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "follow"."""
    parallel = mode.flow == "parallel"
    # With a parallel flow a hand that runs outside a bend needs no course that is faster there.
    course = course_of(maps.curve, mode.damping, 0.0 if parallel else mode.stiffness)
    law = FollowLaw(
        course, mode.stiffness, mode.damping, mode.tube, parallel, compensation(maps.curve, course) * parallel
    )
    law, urged = governed(mode.governor, law, course, maps)
    power = river_power(mode.damping, (PACE_RANGE[1] if parallel else 1.0) * fastest(course))
    springs = ((mode.stiffness, mode.tube),)
    field = FixedField(law, course, power, springs, Notes("FOLLOW", maps.reach), urged, mode.tube)
    return fixed_curve_parts(config, mode, maps, field)


def flows_parallel(config: RunConfig) -> bool:
    """Whether the field keeps the pace of a hand that is pushed off its curve."""
    return isinstance(config.mode, Follow) and config.mode.flow == "parallel"
