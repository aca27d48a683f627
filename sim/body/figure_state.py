"""Gains and state of the physical figure's control: views of the world's arrays, and scratch memory."""

from typing import NamedTuple

from controllers.legs.sole_heights import SWING_HEIGHT
from geometry.arrays import Array, IntArray
from sim.body.falls import TOUCH_HEIGHT, FallState
from sim.body.mass_matrix import MassMatrix

N_FOOT = 4  # contact points of a foot

REPORT_SUPPORT, REPORT_SATURATED, REPORT_RESIDUAL, REPORT_FLIES, REPORT_DOWN, REPORT_SIZE = 0, 1, 2, 8, 9, 10
"""Indices in a figure's report: support (0 while the reference flies or nothing touches the floor), number of saturated
motors, residual (6), 1 while the reference flies, and the mode: 1 while the figure lies after a fall, 2 while it is set
back, else 0."""


class FigureGains(NamedTuple):
    """Feedback gains of the physical figure, and the bounds of its residual wrench.

    Attributes
    ----------
    joint_rate, root_rate : float
        ω of the critically damped feedback on joints and root [1/s]. They must be equal: both determine where a foot in
        stance is to be, and if they differ, the feedback moves a foot that the floor holds. The residual of `hvf track
        walk` is 0.6 % with 40 and 40, 2.7 % with 20 and 40. With 25 and 25 landings of the run are softer, and a figure
        that is led retraces its path less exactly.
    joint_reach : float
        Joint error at which the feedback saturates [rad]: a larger error decays at a constant speed, ω/2 times this, so
        that the motors have torque left to stop the joint. Half or twice the value changes the residual of walk, run
        and jump by at most 0.1 % of weight.
    max_root_acceleration, max_root_angular_acceleration : float
        Largest linear and angular acceleration that feedback may ask of the root [m/s²], [rad/s²], so that a late
        landing is absorbed. Half or twice the values leave the residual of walk, run and jump unchanged.
    linear_limit, angular_limit : float
        Largest acceleration taken from the reference [m/s²], [rad/s²]: captured motion is noisy. Half or twice the
        first leaves the residual of walk, run and jump unchanged; half the second raises the last two by 0.8 and 1.8 %.
    force_bound, moment_bound : float
        Largest residual force as a share of body weight, and moment as a share of body weight × stature: the
        smallest values tried with which every motion that should stand does (docs/validation/residual-bounds.md).
    reference_reach, contact_reach : float
        Height above the floor from which a contact point of the reference, or of the figure itself, bears no load [m].
        Half or twice the first changes the residual of walk, run and jump by at most 0.1 % of weight; half or twice
        the second changes that of the jump by 0.5 and 0.3 %.
    settling_reach : float
        As `contact_reach`, for a point of a foot that bears load on another point [m]: the plan includes a point
        about to touch down, since otherwise the ankle would hold it up. Half or twice the value changes the residual of
        walk, run and jump by at most 0.1 % of weight.
    stance_height : float
        Height of a contact point of the reference from which it is no longer in stance [m]. The residual of walk,
        run and jump is 0.7, 1.6 and 2.9 % of weight; with half the value 0.7, 1.7 and 2.9, with twice 0.8, 2.2 and
        6.5.
    swing_speed : float
        Horizontal speed of a low contact point of the reference from which it is in swing, not in stance [m/s]. Half
        or twice the value changes the residual of walk, run and jump by at most 0.1 % of weight.
    flight_height : float
        The reference flies, and no residual is applied, while all its contact points are higher than this [m]. With
        half or twice the value the residual of the jump is 3.2 or 2.4 % of weight instead of 2.8.
    lift_time, unload_time : float
        Prediction times for contact points of the reference that are about to leave the floor: into a flight, and while
        others bear the load (`sim.body.support`) [s]. Half or twice the first changes the residual of walk, run and
        jump by at most 0.2 % of weight; with half the second the residuals are 0.9, 2.9 and 5.3 %, with twice 0.8, 1.8
        and 3.1. On twelve captures, values from 0.04 to 0.07 s hardly differ.
    placement_reach : float
        Largest horizontal displacement of a foot in flight from its place relative to the root towards its place in the
        world (`sim.body.foot_placement`) [m]. Without it the residual of animated_drawings/jumping is 12.6 % of
        weight, with 8 cm 7.0; half or twice the value changes that of the jump by at most 0.5 %.
    """

    joint_rate: float = 40.0
    root_rate: float = 40.0
    joint_reach: float = 0.15
    max_root_acceleration: float = 30.0
    max_root_angular_acceleration: float = 300.0
    linear_limit: float = 40.0
    angular_limit: float = 500.0
    force_bound: float = 0.5
    moment_bound: float = 0.1
    reference_reach: float = 0.03
    contact_reach: float = TOUCH_HEIGHT
    settling_reach: float = 0.015
    stance_height: float = SWING_HEIGHT
    swing_speed: float = 1.0
    flight_height: float = 0.02
    lift_time: float = 0.02
    unload_time: float = 0.06
    placement_reach: float = 0.08


class FigureState(NamedTuple):
    """Views of the world's MjData, restricted to the figure, and scratch memory.

    Attributes
    ----------
    model, data, twin_model, twin_data : int
        Addresses of the world, and of the twin: the figure alone, on which the reference pose is evaluated.
    qpos, qvel, bias, passive, ctrl, applied : Array
        The figure's part of the world's arrays: 75, 57, 57, 57, 51 motors and the 6 degrees of freedom of the root.
    xpos, xmat : Array
        Positions (18, 3) and rotation matrices (18, 9) of the figure's bodies.
    contact_pos, contact, contact_body : Array
        Positions of all geoms of the world, indices of the contact spheres in them (10,), and indices of the spheres'
        bodies among the figure's (10,).
    twin_qpos, twin_contact_pos, twin_contact : Array
        Configuration, geom positions and indices of the contact spheres of the twin.
    mass : MassMatrix
        Mass matrix of the figure's degrees of freedom.
    parent, legs : IntArray
        Parent of each body, and thigh, shank and foot of each leg, shape (2, 3).
    torque_limit : Array
        Torque limits of the motors [N m], shape (51,).
    weight, stature, radius, friction : float
        Body weight [N], stature [m], radius of the contact spheres [m], coefficient of friction in the plan.
    acceleration, wanted_root : Array
        Planned acceleration (57), and the wanted acceleration of the root before contacts are planned (6).
    loaded : Array
        1 where a foot touches the floor, 0 where it does not, shape (2,).
    share, near : Array
        Share of load that each contact point may bear, and degree to which it is in stance in the reference, 0 to 1,
        shape (10,).
    force, given : Array
        Planned contact forces [N] in the world (10, 3) and their generalised forces (57).
    wrench : Array
        Residual: force in the world [N], moment in the root's frame [N m], shape (6,).
    lost, yielding : Array
        Torque beyond each motor's limit [N m], and 1 where the joint's acceleration is reduced, shape (51,).
    report : Array
        See `REPORT_SUPPORT` and the indices beside it, shape (10,).
    fall : FallState
        State of fall detection and recovery.
    """

    model: int
    data: int
    twin_model: int
    twin_data: int
    gains: FigureGains
    qpos: Array
    qvel: Array
    bias: Array
    passive: Array
    ctrl: Array
    applied: Array
    xpos: Array
    xmat: Array
    contact_pos: Array
    contact: IntArray
    contact_body: IntArray
    twin_qpos: Array
    twin_contact_pos: Array
    twin_contact: IntArray
    mass: MassMatrix
    parent: IntArray
    legs: IntArray
    torque_limit: Array
    weight: float
    stature: float
    radius: float
    friction: float
    acceleration: Array
    wanted_root: Array
    rotation: Array
    loaded: Array
    share: Array
    near: Array
    points: Array
    edges: Array
    edge_share: Array
    edge_force: Array
    scaled: Array
    residual: Array
    force: Array
    given: Array
    demand: Array
    wrench: Array
    offset: Array
    response: Array
    lost: Array
    yielding: IntArray
    block: Array
    correction: Array
    report: Array
    fall: FallState
