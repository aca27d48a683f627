"""FOLLOW as a run: one river along the map's curve."""

from controllers.fields.follow import Follow as FollowLaw
from controllers.safety.energy_tank import river_power
from experiments.config.modes import Follow
from experiments.config.run_config import RunConfig
from experiments.setups.budget import fastest
from experiments.setups.fixed_curve import FixedField, fixed_curve_parts
from experiments.setups.governor import governed
from experiments.setups.parts import ClipMapParts, Notes, Parts


def follow_parts(config: RunConfig, mode: Follow, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "follow"."""
    course = maps.course(mode.damping, mode.stiffness)
    law, urged = governed(mode.governor, FollowLaw(course, mode.stiffness, mode.damping, mode.tube), course, maps)
    power, springs = river_power(mode.damping, fastest(course)), ((mode.stiffness, mode.tube),)
    field = FixedField(law, course, power, springs, Notes("FOLLOW", maps.reach), urged, mode.tube)
    return fixed_curve_parts(config, mode, maps, field)
