"""Set-up of the mode "bunny": an attractor that runs along a curve."""

import numpy as np

from controllers.fields.bunny import Bunny as BunnyLaw
from controllers.safety.energy_tank import river_power
from controllers.safety.limiter import ForceLimiter
from experiments.config.modes import Bunny
from experiments.config.run_config import RunConfig
from experiments.setups.modes.fixed_curve import FixedField, fixed_curve_parts
from experiments.setups.parts.budget import fastest
from experiments.setups.parts.governor import governed
from experiments.setups.parts.part_types import ClipMapParts, Notes, Parts


def bunny_parts(config: RunConfig, mode: Bunny, maps: ClipMapParts) -> Parts:
    """Parts of a run in the mode "bunny".

    Besides its damper, the moving spring injects at most min(k_r δ e^{-1/2}, F_p) |φ̇|, with the limiter's peak F_p.
    """
    course, width = maps.curve, mode.bunny_width
    bunny = BunnyLaw(course, mode.stiffness, mode.damping, width, mode.bunny_attraction, mode.bunny_pace)
    law, urged = governed(mode.governor, bunny, course, maps)
    pace, force = fastest(course), ForceLimiter(config.clock.servo_period).peak
    power = river_power(mode.damping, pace) + pace * min(mode.stiffness * width * np.exp(-0.5), force)
    # The attractor's potential, ∫ k s exp(−s²/2δ²) ds = k δ², is the energy of a linear spring of reach √2 δ.
    springs = ((mode.stiffness, np.sqrt(2.0) * width),)
    return fixed_curve_parts(
        config, mode, maps, FixedField(law, course, power, springs, Notes("BUNNY", maps.reach), urged)
    )
