"""LEADING as a run: the field, its tank, and a hand that leads the figure."""

from dataclasses import replace

import numpy as np

from controllers.fields.leading import Leading
from controllers.safety.limiter import ForceLimiter
from controllers.walking.gait import Gait
from controllers.walking.walking import Walking
from experiments.config.modes import Lead
from experiments.config.run_config import RunConfig
from experiments.results.measures.lead_measures import lead_summary
from experiments.results.measures.summary import RunSummary
from experiments.setups.parts.budget import WORKSPACE_WIDTH, fastest, tank_for
from experiments.setups.parts.hands import participant
from experiments.setups.parts.leading_hand import HALF_TURN, leading_hand, s_curve
from experiments.setups.parts.led_figure import LedParts
from experiments.setups.parts.part_types import Measuring, Notes, Parts
from geometry.arrays import Array
from sim.body.figure import FigureGains
from sim.users.hand.arm import Arm
from sim.users.intents import Lead as LeadIntent
from sim.users.participant import Participant

TRAVEL_TIME = 5.0  # [s] along the S at the clip's own pace, at least
# Least length of the S over the distance at which the figure follows the stylus. A shorter one is over before a slow
# gait has turned: a zombie's walk (0.34 m/s) was 0.5 m beside an S of 1.7 m, and the field asked for 7.4 N.
_LEAST_TRAVEL = 3.0
_START_RADIUS = 0.025  # [m] largest distance of the hand from its place on the curve at the start
# Largest lateral acceleration of a gait with flights [m/s²]: leaning more, the figure falls after a slightly missed
# landing.
_MAX_FLYING_LATERAL = 1.2
# Largest pace of a gait with flights over the clip's own: played faster, it lands late, since gravity stays the same.
# The same holds for a run led by steps: its limbs already swing as fast as in the run; if they swing faster, motors of
# the stance leg saturate.
_MAX_RUNNING_PACE = 1.0
# A foot that is planned to bear load but is not held in place twists on the spot. A led figure may stop anywhere, so
# its contact points are unloaded at half the height (reference_reach) at which they are released (stance_height).
_WALKING = FigureGains(reference_reach=0.006, stance_height=0.012, lift_time=0.005, unload_time=0.005)
# A gait with flights changes feet within a hundredth of a second, and with the low reach would stand on neither foot.
_FLYING = _WALKING._replace(reference_reach=0.012)


def lead_parts(config: RunConfig, mode: Lead, maps: LedParts) -> Parts:
    """Parts of a run in the mode "lead"."""
    field, course = leading(mode, maps.gait), s_curve()
    config = replace(config, mode=replace(mode, floor_scale=field.walking.scale))
    limiter = ForceLimiter(config.clock.servo_period)
    tank = tank_for(limiter.peak * fastest(course), ((np.inf, WORKSPACE_WIDTH),), _START_RADIUS, limiter)
    gait = field.walking.gait
    static = {"lead_scale": field.walking.scale, "lead_stride": gait.stride, "lead_support": gait.support.astype(float)}
    arm = leading_hand(field)
    until = len(arm.path) * arm.period
    late = f"the hand leads until {until:.1f} s; give --seconds more than that"
    notes = Notes("LEAD", 0.0, "", "the figure's path", "leads", static)

    def summarise(summary: RunSummary, of: Measuring) -> RunSummary:
        lead = lead_summary(of.recording, gait, of.walkers, config.scene, summary.figure)
        return replace(summary, lead=lead)

    return Parts(
        config=config, maps=maps, field=field, program=field.program(), course=course, user=_make_hand(config, arm),
        tank=tank, notes=notes, gains=_FLYING if maps.haptic_map.flies else _WALKING, walking=field.walking,
        argument_at=lambda nearest, phases: walker_argument(phases), handled=((0.0, np.inf),), summarise=summarise,
        remarks=(late,) if config.seconds <= until else (),
    )  # fmt: skip


def leading(mode: Lead, gait: Gait) -> Leading:
    """Field of the mode "lead".

    Raises
    ------
    ParameterError
        If a number is out of its interval.
    """
    curve = s_curve()
    x, y, _ = curve.point(curve.start)
    flying = {"lateral": _MAX_FLYING_LATERAL} if gait.flies else {}
    running = {"forward": _MAX_RUNNING_PACE} if gait.flies or gait.grounded else {}
    walking = Walking(gait, (float(x), float(y)), -HALF_TURN, **flying, **running)
    # The path is steered from its front, D ahead of the figure. At the gait's own pace the stylus is 2 v/ω beyond it,
    # and the damping ratio of the steering on a straight line is √2 v/(ω D): 0.7 or more.
    walking = replace(walking, rate=min(walking.rate, 2.0 * gait.speed / walking.ahead))
    length = max(TRAVEL_TIME * gait.speed, _LEAST_TRAVEL * (walking.ahead + walking.lead[0]))
    scale = length / curve.length if mode.floor_scale is None else mode.floor_scale
    walking = replace(walking, scale=scale)
    return Leading(walking, k_l=mode.leash, b=mode.damping)


def _make_hand(config: RunConfig, arm: Arm) -> Arm | Participant:
    """The hand that leads: an arm's impedance, or a person along the same path."""
    person = config.user.person
    if person is None:
        return arm
    return participant(person, LeadIntent(arm.path, arm.period), s_curve(), config.seconds, config.seed)


def walker_argument(s: Array) -> Array:
    """Arguments (n, 7) of the led figure's map at arc lengths s (n,) [m]."""
    argument = np.zeros((len(s), 7))
    argument[:, 0], argument[:, 3] = s, 1.0
    return argument
